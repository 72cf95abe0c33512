"""Limits that protect clients from each other: the size of bodies, and deadlines for requests and for reading."""

import asyncio
import zlib
from collections.abc import Mapping
from typing import Any

import h11
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from dropanchor_schemas.sentences import say
from dropanchor_service.api.http.errors import Kind, ProblemError, problem_response
from dropanchor_service.api.http.open_sockets import OpenSockets
from dropanchor_service.api.http.site_in_path import divided, is_omlox

_UNPACKED = ("gzip", "x-gzip", "deflate")
_OF_PACKED = (b"content-encoding", b"content-length")


class BodyLimit:
    """ASGI middleware that answers 413 to a larger body, by its `content-length` or once it has grown too large.

    It unpacks gzip and deflate, and answers 415 to any other content encoding.
    """

    def __init__(self, app: ASGIApp, max_bytes: int, of_paths: Mapping[str, int] | None = None) -> None:
        """max_bytes: of the paths that are not in of_paths."""
        self._app = app
        self._max_bytes = max_bytes
        self._of_paths = of_paths or {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        max_bytes = self._of_paths.get(divided(scope["path"])[1], self._max_bytes)
        content_length = Headers(scope=scope).get("content-length", "0")
        if content_length.isdigit() and int(content_length[:20]) > max_bytes:
            response = problem_response(Request(scope), Kind.BODY_TOO_LARGE, _too_large(max_bytes))
            await response(scope, receive, send)
            return
        packing = Headers(scope=scope).get("content-encoding", "identity").strip().lower()
        if packing == "identity":
            await self._app(scope, _counted(receive, max_bytes), send)
        elif packing in _UNPACKED:
            headers = [(name, value) for name, value in scope["headers"] if name.lower() not in _OF_PACKED]
            unpacked = _unpacked(receive, packing, max_bytes)
            await self._app({**scope, "headers": headers}, _counted(unpacked, max_bytes), send)
        else:
            detail = say(
                "content_encoding",
                "The Content-Encoding {packing} is not read: gzip, deflate or none is.",
                packing=packing,
            )
            await problem_response(Request(scope), Kind.UNKNOWN_CONTENT_ENCODING, detail)(scope, receive, send)


def _unpacked(receive: Receive, packing: str, max_bytes: int) -> Receive:
    """Return the messages with their bodies unpacked, to a little more than `max_bytes` at most."""
    unpacker = zlib.decompressobj(zlib.MAX_WBITS | 32)  # of gzip and of zlib, whichever it is

    async def unpacked() -> Message:
        message = await receive()
        try:
            body = unpacker.decompress(message.get("body", b""), max_bytes + 1)
        except zlib.error:
            raise ProblemError(Kind.INVALID_REQUEST, _not_packed(packing)) from None
        is_whole = (
            unpacker.eof or unpacker.unconsumed_tail or message.get("more_body") or message["type"] != "http.request"
        )
        if not is_whole or unpacker.unused_data:  # a second packed body behind the first would be lost without a word
            raise ProblemError(Kind.INVALID_REQUEST, _not_packed(packing))
        return {**message, "body": body}

    return unpacked


def _not_packed(packing: str) -> str:
    return say("not_packed", "The body is not whole {packing}, which Content-Encoding says it is.", packing=packing)


def _counted(receive: Receive, max_bytes: int) -> Receive:
    received = 0

    async def counted() -> Message:
        nonlocal received
        message = await receive()
        received += len(message.get("body", b""))
        if received > max_bytes:
            raise ProblemError(Kind.BODY_TOO_LARGE, _too_large(max_bytes))
        return message

    return counted


def _too_large(max_bytes: int) -> str:
    return say("body_too_large", "A request body may have at most {bytes} bytes.", bytes=max_bytes)


class EscapedPath:
    """ASGI middleware that keeps the paths of the interface escaped, so that an id may contain an escaped slash."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        raw = (scope.get("raw_path") or b"").decode("latin-1")
        if raw.startswith("/api/") or is_omlox(raw):
            scope = {**scope, "path": raw}
        await self._app(scope, receive, send)


class GuardedProtocol(H11Protocol):
    """HTTP/1.1 with two deadlines that uvicorn lacks.

    It disconnects a client that does not complete its request in time, and one that stops reading its response. A large
    body may take longer, as long as it does not come too slowly.
    """

    request_s = 10.0
    least_bytes_per_s = 100_000
    stalled_s = 10.0
    stalled_at_shutdown_s = 0.5

    _deadline: asyncio.TimerHandle | None = None
    _stall: asyncio.TimerHandle | None = None
    _is_web_socket = False
    _number = -1  # file descriptor
    _sockets: OpenSockets | None = None
    _received = 0  # bytes, since the deadline was set

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        # Pause the writer as soon as the kernel does not accept data, so that nothing piles up in this process. The
        # limit is 1 because asyncio's TLS transport treats even an empty buffer as full with 0.
        transport.set_write_buffer_limits(high=1)
        self._deadline = self.loop.call_later(self.request_s, self._cut_if_slow)
        self._number = transport.get_extra_info("socket").fileno()
        self._sockets = getattr(self.server_state, "sockets", None)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self._received += len(data)
        incomplete = not self._is_web_socket and self.conn.their_state in (h11.IDLE, h11.SEND_BODY)
        if not incomplete:
            self._deadline = _cancelled(self._deadline)
            self._note_busy()
        elif self._deadline is None:
            self._received = 0
            self._deadline = self.loop.call_later(self.request_s, self._cut_if_slow)

    def on_response_complete(self) -> None:
        if self._sockets is not None and not self.transport.is_closing():
            self._sockets.note_silent(self._number)
        super().on_response_complete()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        super().handle_websocket_upgrade(event)
        self._is_web_socket = True  # another protocol has the connection now
        self._note_busy()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._watch_stall()

    def resume_writing(self) -> None:
        super().resume_writing()
        self._stall = _cancelled(self._stall)

    def shutdown(self) -> None:
        # uvicorn closes the transport here. Closed a second time, asyncio's TLS transport lets go of its connection,
        # and nothing could cut a client that does not read its last response.
        if not self.transport.is_closing():
            super().shutdown()
        if self.flow.write_paused:
            self.stalled_s = self.stalled_at_shutdown_s
            _cancelled(self._stall)
            self._watch_stall()

    def connection_lost(self, exc: Exception | None) -> None:
        self._deadline = _cancelled(self._deadline)
        self._stall = _cancelled(self._stall)
        super().connection_lost(exc)

    def _note_busy(self) -> None:
        if self._sockets is not None:
            self._sockets.note_busy(self._number)

    def _watch_stall(self) -> None:
        waiting = self._waiting()
        if waiting is not None:
            self._stall = self.loop.call_later(self.stalled_s, self._cut_if_stalled, waiting)

    def _cut_if_slow(self) -> None:
        if self._received < self.request_s * self.least_bytes_per_s:
            self._cut()
        else:
            self._received = 0
            self._deadline = self.loop.call_later(self.request_s, self._cut_if_slow)

    def _cut_if_stalled(self, waiting_then: int) -> None:
        waiting = self._waiting()
        if waiting is not None and waiting >= waiting_then:
            self._cut()
        else:
            self._watch_stall()

    def _waiting(self) -> int | None:
        """Return how many bytes wait to be sent; None after asyncio's TLS transport has let go of its connection."""
        try:
            return self.transport.get_write_buffer_size()
        except AttributeError:
            if self.transport.is_closing():
                return None
            raise

    def _cut(self) -> None:
        self.transport.abort()


def _cancelled(timer: asyncio.TimerHandle | None) -> Any:
    """Cancel a timer if there is one. Return None, to assign to where the timer was stored."""
    if timer is not None:
        timer.cancel()

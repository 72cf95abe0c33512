"""Pass requests on to the owners of the sites, and their answers back."""

import asyncio
import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress

import httpx
from starlette.requests import HTTPConnection, Request
from starlette.types import Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from dropanchor_service.api.http.access import bearer_of, identify, secret_of
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.of_cluster import BUCKET, EPOCH, OF_NODES
from dropanchor_service.api.http.permissions import INGEST, OF_ALL_SITES
from dropanchor_service.api.http.site_in_path import divided
from dropanchor_service.api.routes.ingest_stream import key_among_protocols
from dropanchor_service.api.routes.poses import PIECE_BYTES
from dropanchor_service.metrics.node import NodeMetrics
from dropanchor_service.node import sentences
from dropanchor_service.node.all_sites import Part, joined, parts_of, refusal_of
from dropanchor_service.node.forwarding import Answer, FollowedError, Forwarding, while_connected, while_newest
from dropanchor_service.node.owners import Owners
from dropanchor_service.node.request import (
    Asked,
    Body,
    ClientGoneError,
    RawHeaders,
    headers_for_client,
    headers_for_owner,
    target_of,
)
from dropanchor_service.node.routing import Unknown, bucket_for
from dropanchor_service.node.sockets import Sockets, close
from dropanchor_service.security.identity import Authenticator, UnauthenticatedError

_INTERNAL = frozenset({BUCKET, EPOCH, *OF_NODES})
_STREAM = "text/event-stream"

_log = logging.getLogger(__name__)


class Sending:
    """Sends an answer. is_complete: whether the client has all of it, or gets its end now."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self.is_complete = False

    async def __call__(self, message: Message) -> None:
        self.is_complete = message["type"] == "http.response.body" and not message.get("more_body", False)
        await self._send(message)


class Gateway:
    """An ASGI application. secret: what the services know the nodes by. authenticator: None when nobody needs a key."""

    def __init__(
        self,
        owners: Owners,
        forwarding: Forwarding,
        sockets: Sockets,
        metrics: NodeMetrics,
        secret: bytes,
        authenticator: Authenticator | None,
    ) -> None:
        self._owners = owners
        self._forwarding = forwarding
        self._sockets = sockets
        self._metrics = metrics
        self._secret = secret
        self._authenticator = authenticator

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Raises ProblemError before an answer has begun."""
        with self._metrics.open.track_inprogress():
            if scope["type"] == "websocket":
                await self._serve_socket(WebSocket(scope, receive, send))
                return
            with suppress(ClientGoneError):
                await self._serve(Request(scope), receive, send)

    async def _serve(self, request: Request, receive: Receive, to_client: Send) -> None:
        send = Sending(to_client)
        body = Body(receive)
        await body.begin()
        scope = request.scope
        request_id = scope["state"]["request_id"]
        headers = headers_for_owner(scope, self._secret, request_id)
        asked = Asked(scope["method"], target_of(scope), headers, body, request_id)
        is_of_all = scope["path"] in OF_ALL_SITES and asked.method == "GET" and len(self._owners.buckets) > 1
        if is_of_all:
            work = self._answer_for_all(asked, send)
        else:
            work = self._answer(await self._bucket(request, secret_of(request)), asked, send)
        await (while_connected(work, _gone(receive, send)) if body.is_whole else work)

    async def _answer(self, bucket: str, asked: Asked, send: Send) -> None:
        began_s = time.monotonic()
        try:
            answer = await self._forwarding.ask(bucket, asked)
        except ProblemError as error:
            self._metrics.requests.labels(str(error.status_code)).inc()
            _log.info("request %s was not answered: %s", asked.request_id, error.detail)
            raise
        self._metrics.seconds.observe(time.monotonic() - began_s)
        self._metrics.requests.labels(str(answer.response.status_code)).inc()
        try:
            await self._relay(answer, asked, send)
        finally:
            await answer.close()

    async def _relay(self, answer: Answer, asked: Asked, send: Send) -> None:
        """Send an answer to the client. One that is cut short ends the connection, so that the client notices."""
        headers = headers_for_client(answer.response.headers.raw, _INTERNAL)
        await send({"type": "http.response.start", "status": answer.response.status_code, "headers": headers})
        try:
            await while_newest(_send_body(answer, send), self._owners.followed(answer.owner))
        except (FollowedError, httpx.TransportError) as error:
            why = str(error) or "it has a successor"
            _log.info("the answer of %s to request %s ended early: %s", answer.owner.name, asked.request_id, why)
            if answer.response.headers.get("content-type", "").startswith(_STREAM):
                await send({"type": "http.response.body", "body": b"", "more_body": False})

    async def _answer_for_all(self, asked: Asked, send: Send) -> None:
        parts = await parts_of(self._forwarding, self._owners.buckets, asked)
        refusal = refusal_of(parts)
        if refusal is not None:
            await _send_whole(refusal, [refusal.body or b""], send)
            return
        chunks = list(joined(parts))
        await _send_whole(next(part for part in parts if part.sites is not None), chunks, send)

    async def _serve_socket(self, socket: WebSocket) -> None:
        scope = socket.scope
        try:
            bucket = await self._bucket(socket, bearer_of(socket) or key_among_protocols(socket))
            owner = self._forwarding.owner(bucket)
        except ProblemError as error:
            await close(socket, error.detail)
            return
        headers = headers_for_owner(scope, self._secret, scope["state"]["request_id"])
        await self._sockets.forward(socket, owner, target_of(scope), headers)

    async def _bucket(self, connection: HTTPConnection, key: str) -> str:
        """Return the bucket that a request is about. Raises ProblemError."""
        path = connection.scope["path"]
        site, buckets = divided(path)[0], self._owners.buckets
        if site is None and len(buckets) > 1 and path.startswith(INGEST):
            try:
                site = await self._site_of(key)
            except UnauthenticatedError:
                return buckets[0]  # every owner refuses the key, and says why
        found = bucket_for(path, site, buckets)
        if not isinstance(found, Unknown):
            return found
        raise {
            Unknown.NO_BUCKETS: ProblemError(Kind.NOT_READY, sentences.NO_BUCKETS),
            Unknown.SITE: ProblemError(Kind.UNKNOWN_SITE, f"There is no site {site!r}. /api/v1/sites lists the sites."),
            Unknown.NO_SITE: ProblemError(
                Kind.SEVERAL_SITES,
                f"{path} names no site, but there are several: name one, as in /api/v1/sites/SITE/poses. /api/v1/sites "
                "lists the sites.",
            ),
        }[found]

    async def _site_of(self, key: str) -> str | None:
        """Return the site of a tag's key. Raises UnauthenticatedError."""
        if self._authenticator is None:
            return None
        return (await identify(self._authenticator, key)).site


async def _send_body(answer: Answer, send: Send) -> None:
    """Send the body as it comes, and end it with its last bytes if their number is known."""
    left = int(answer.response.headers.get("content-length", "-1"))
    async for chunk in answer.chunks():
        left -= len(chunk)
        await send({"type": "http.response.body", "body": chunk, "more_body": left != 0})
    if left != 0:
        await send({"type": "http.response.body", "body": b"", "more_body": False})


async def _send_whole(part: Part, chunks: Sequence[bytes | memoryview], send: Send) -> None:
    """Send an answer with the status and the headers of a part."""
    headers: RawHeaders = [
        (name, value)
        for name, value in headers_for_client(part.headers or [], _INTERNAL)
        if name not in (b"content-length", b"etag")
    ]
    headers.append((b"content-length", str(sum(map(len, chunks))).encode()))
    await send({"type": "http.response.start", "status": part.status, "headers": headers})
    for piece in _in_pieces(chunks):
        await send({"type": "http.response.body", "body": piece, "more_body": True})
        await asyncio.sleep(0)
    await send({"type": "http.response.body", "body": b"", "more_body": False})


def _in_pieces(chunks: Sequence[bytes | memoryview]) -> Iterator[bytes | memoryview]:
    for chunk in chunks:
        view = memoryview(chunk)
        yield from (view[begin : begin + PIECE_BYTES] for begin in range(0, len(view), PIECE_BYTES))


async def _gone(receive: Receive, sending: Sending) -> None:
    """Return when the client has disconnected before it had its answer."""
    while (await receive())["type"] != "http.disconnect":
        pass
    if sending.is_complete:
        await asyncio.Event().wait()  # the server says that of every client in the end

"""Pass a WebSocket on to the owner of its site."""

import asyncio
from collections.abc import Awaitable
from contextlib import suppress
from urllib.parse import urlsplit

import httpx
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidMessage
from websockets.typing import Subprotocol

from dropanchor_schemas.sentences import say
from dropanchor_service.api.http.closing import reason_of
from dropanchor_service.api.http.of_cluster import epoch_in
from dropanchor_service.api.http.web_sockets import MAX_MESSAGE_BYTES
from dropanchor_service.node import sentences
from dropanchor_service.node.forwarding import FollowedError, while_newest
from dropanchor_service.node.links import Links
from dropanchor_service.node.owners import Owner, Owners
from dropanchor_service.node.request import RawHeaders

RESTART = 1012
_NO_STATUS, _ABNORMAL = 1005, 1006
_OPEN_S = 5.0
_MADE_BY_THE_CLIENT = frozenset(
    {*("sec-websocket-key", "sec-websocket-version", "sec-websocket-extensions", "sec-websocket-protocol", "upgrade")}
)


class Sockets:
    """Connects clients to owners."""

    def __init__(self, owners: Owners, links: Links) -> None:
        self._owners = owners
        self._links = links

    async def forward(self, socket: WebSocket, owner: Owner, target: bytes, headers: RawHeaders) -> None:
        """Serve a client, which has not been accepted, until one of both ends."""
        try:
            async with self._connection(socket, owner, target, headers) as upstream:
                answering = self._answering(owner, upstream)
                await socket.accept(upstream.subprotocol)
                await while_newest(_pass_on(socket, upstream), self._owners.followed(answering))
        except FollowedError:
            await close(socket, sentences.socket_followed(owner.bucket))
        except (OSError, TimeoutError, InvalidHandshake, InvalidMessage):
            await close(socket, sentences.socket_unreachable(owner))

    def _connection(self, socket: WebSocket, owner: Owner, target: bytes, headers: RawHeaders) -> connect:
        base = httpx.URL(owner.address)
        scheme = "wss" if base.scheme == "https" else "ws"
        prefix = base.raw_path.rstrip(b"/")
        return connect(
            f"{scheme}://{urlsplit(owner.address).netloc}{(prefix + target).decode('ascii')}",
            additional_headers=[
                (name.decode("latin-1"), value.decode("latin-1"))
                for name, value in headers
                if name.decode("latin-1") not in _MADE_BY_THE_CLIENT
            ],
            subprotocols=[Subprotocol(name) for name in socket.scope.get("subprotocols", [])] or None,
            ssl=self._links.certificates if scheme == "wss" else None,
            compression=None,
            user_agent_header=None,
            proxy=None,
            open_timeout=_OPEN_S,
            max_size=MAX_MESSAGE_BYTES,
        )

    def _answering(self, owner: Owner, upstream: ClientConnection) -> Owner:
        """Return who has accepted the connection. Raises FollowedError if it is not the newest owner."""
        assert upstream.response is not None
        headers = {name.lower(): value for name, value in upstream.response.headers.raw_items()}
        epoch = epoch_in(headers, owner.bucket)
        answering = None if epoch is None else self._owners.accepted(owner, epoch)
        if answering is None:
            raise FollowedError
        return answering


async def close(socket: WebSocket, reason: str) -> None:
    """End a connection, so that the client makes another one. A client reads the reason of an accepted one only."""
    with suppress(RuntimeError, WebSocketDisconnect):
        if socket.application_state.name == "CONNECTING":
            await socket.accept()
        await socket.close(RESTART, reason_of(reason, socket.scope))


async def _pass_on(socket: WebSocket, upstream: ClientConnection) -> None:
    """Pass messages on in both directions until one side ends."""
    both: list[Awaitable[None]] = [_to_owner(socket, upstream), _to_client(upstream, socket)]
    tasks = [asyncio.ensure_future(each) for each in both]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in tasks:
            if task.done():
                task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)


async def _to_owner(socket: WebSocket, upstream: ClientConnection) -> None:
    while (message := await socket.receive())["type"] == "websocket.receive":
        text = message.get("text")
        try:
            await upstream.send(message["bytes"] if text is None else text)
        except ConnectionClosed:
            await _close_as(upstream, socket)
            return
    await upstream.close()


async def _to_client(upstream: ClientConnection, socket: WebSocket) -> None:
    try:
        async for message in upstream:
            await (socket.send_text(message) if isinstance(message, str) else socket.send_bytes(message))
    except ConnectionClosed:
        pass
    except WebSocketDisconnect:
        return
    await _close_as(upstream, socket)


async def _close_as(upstream: ClientConnection, socket: WebSocket) -> None:
    """Close the client's connection as the owner closed its own."""
    code = upstream.close_code
    if code in (None, _NO_STATUS, _ABNORMAL):
        await close(socket, say("owner_away", "The owner of the site is gone. Connect again."))
        return
    assert code is not None
    with suppress(RuntimeError, WebSocketDisconnect):
        await socket.close(code, upstream.close_reason or "")

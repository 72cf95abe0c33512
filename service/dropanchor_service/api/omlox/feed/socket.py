"""Serve the WebSocket: answer requests, and send each client what its subscriptions have not received yet.

Every client reads the stores at its own pace, so nothing queues up for a slow one. It misses positions that newer ones
have replaced, and no event.
"""

import asyncio
import itertools
import sqlite3
import time
from dataclasses import dataclass
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from dropanchor_service.answers.answers import to_json
from dropanchor_service.api.http.access import LOOPBACK, bearer_of, client_of, identify
from dropanchor_service.api.http.connections import TooManyConnectionsError
from dropanchor_service.api.http.errors import ProblemError
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.omlox.feed.messages import Code, FeedError, Request, params_of, request_of
from dropanchor_service.api.omlox.feed.topics import Feed, feed_of
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.hub_of_request import hub_of
from dropanchor_service.api.omlox.routes.providers import TAKES_NO_POSITIONS
from dropanchor_service.api.routes.shared_parts import SharedParts, shared_of
from dropanchor_service.api.routes.stream import stopped_within
from dropanchor_service.security.identity import Identity, UnauthenticatedError

PERIOD_S = 0.1
PAUSE_PER_WORK = 3.0  # so a connection takes at most a quarter of a core
CONNECTIONS_PER_CLIENT = 16
MAX_SUBSCRIPTIONS = 32  # of one connection

RESTART, UNKNOWN_SITE, TOO_MANY = 1012, 4404, 4429
_AUTHENTICATE = (
    "Send an API key or a token in the header `Authorization: Bearer …` of the handshake, or as params.token of every "
    "message."
)


@dataclass(frozen=True)
class Subscription:
    """identity: who has subscribed; None without authentication."""

    topic: str
    feed: Feed
    identity: Identity | None


router = Router()
_numbers = itertools.count(1)


@router.websocket("/ws/socket")
async def serve(socket: WebSocket) -> None:
    await socket.accept()
    client, shared = client_of(socket, None), shared_of(socket)
    try:
        with shared.feed_connections.one_more(client, CONNECTIONS_PER_CLIENT):
            await Connection(socket, hub_of(socket), shared, _numbers).serve()
    except ProblemError:
        await socket.close(UNKNOWN_SITE, "There is no site with this id.")
    except TooManyConnectionsError:
        await socket.close(TOO_MANY, f"This client has {CONNECTIONS_PER_CLIENT} connections: end one first.")


class Connection:
    """One client. numbers: of subscriptions, of all connections together."""

    def __init__(self, socket: WebSocket, hub: Hub, shared: SharedParts, numbers: "itertools.count[int]") -> None:
        self._socket = socket
        self._hub = hub
        self._shared = shared
        self._numbers = numbers
        self._subscriptions: dict[int, Subscription] = {}
        self._sending = asyncio.Lock()

    async def serve(self) -> None:
        """Serve the client until it is gone."""
        try:
            async with asyncio.TaskGroup() as tasks:
                news = tasks.create_task(self._send_news())
                await self._answer_requests()
                news.cancel()
        except* WebSocketDisconnect:
            pass

    async def _answer_requests(self) -> None:
        while (message := await self._socket.receive())["type"] == "websocket.receive":
            await self._wait_for_turn()
            async with self._sending:  # no news of a subscription before its answer
                try:
                    answer = await self._answer(request_of(message.get("text") or ""))
                except FeedError as error:
                    answer = error.message()
                await self._send(answer)

    async def _answer(self, request: Request) -> dict[str, Any]:
        match request.event:
            case "subscribe":
                return await self._subscribe(request)
            case "unsubscribe":
                return self._unsubscribe(request)
            case "message":
                raise FeedError(Code.NOT_AUTHORIZED, TAKES_NO_POSITIONS)
        raise FeedError(Code.UNKNOWN_EVENT, "The events of clients are subscribe and unsubscribe.")

    async def _subscribe(self, request: Request) -> dict[str, Any]:
        params = params_of(request.params)
        identity = await self._identity(params.token)
        feed = feed_of(self._hub, request.topic, params)
        if len(self._subscriptions) >= MAX_SUBSCRIPTIONS:
            raise FeedError(
                Code.SUBSCRIPTION_FAILED, f"This connection has {MAX_SUBSCRIPTIONS} subscriptions: end one first."
            )
        number = next(self._numbers)
        self._subscriptions[number] = Subscription(request.topic or "", feed, identity)
        return {"event": "subscribed", "topic": request.topic, "subscription_id": number}

    def _unsubscribe(self, request: Request) -> dict[str, Any]:
        ended = self._subscriptions.pop(request.subscription_id or 0, None)
        if ended is None:
            raise FeedError(Code.UNSUBSCRIBE_FAILED, "subscription_id: this connection has no such subscription.")
        return {"event": "unsubscribed", "topic": ended.topic, "subscription_id": request.subscription_id}

    async def _identity(self, token: str | None) -> Identity | None:
        authenticator = self._shared.authenticator
        if authenticator is None:
            return None
        secret = token or bearer_of(self._socket)
        if not secret:
            raise FeedError(Code.NOT_AUTHENTICATED, _AUTHENTICATE)
        try:
            identity = await identify(authenticator, secret)
        except UnauthenticatedError as error:
            raise FeedError(Code.NOT_AUTHENTICATED, f"Authentication failed: {error}. {_AUTHENTICATE}") from error
        if identity.scope_in(self._hub.answers.site.site.id) is None:
            raise FeedError(Code.NOT_AUTHORIZED, "Subscribing needs a key with the scope read.")
        if identity.limit is not None:
            raise FeedError(Code.NOT_AUTHORIZED, "This share link shows its tags and nothing else.")
        return identity

    async def _wait_for_turn(self) -> None:
        """Wait until the rate limit allows another message."""
        limiter, client = self._shared.rate_limiter, client_of(self._socket, None)
        if limiter is None or (self._shared.authenticator is None and client == LOOPBACK):
            return
        while wait_s := limiter.wait_s(client):
            await asyncio.sleep(wait_s)

    async def _send_news(self) -> None:
        pause_s = PERIOD_S
        while not await stopped_within(pause_s, self._shared.stopping):
            if not self._subscriptions:
                continue
            began_s = time.monotonic()
            news = await asyncio.to_thread(self._news)
            pause_s = PERIOD_S + PAUSE_PER_WORK * (time.monotonic() - began_s)
            for number, message in news:
                async with self._sending:
                    if number in self._subscriptions or message["event"] == "error":
                        await self._send(message)
        await self._socket.close(RESTART, "The service stops. Connect again.")

    def _news(self) -> list[tuple[int, dict[str, Any]]]:
        """Return the messages that are due, and the number of the subscription of each."""
        subscriptions = list(self._subscriptions.items())
        return [(number, message) for number, one in subscriptions for message in self._news_of(number, one)]

    def _news_of(self, number: int, subscription: Subscription) -> list[dict[str, Any]]:
        """Return the messages that are due to a subscription. End it if it is no longer possible."""
        try:
            self._require_valid(subscription)
            payloads = list(subscription.feed.payloads())
        except ProblemError as error:
            return self._ended(number, FeedError(Code.SUBSCRIPTION_FAILED, f"This subscription ends: {error.detail}"))
        except FeedError as error:
            return self._ended(number, error)
        except sqlite3.Error:
            return []  # the service reports it as impaired; the events follow as soon as they can be read
        return [{"event": "message", "topic": subscription.topic, "payload": payload} for payload in payloads]

    def _ended(self, number: int, error: FeedError) -> list[dict[str, Any]]:
        self._subscriptions.pop(number, None)
        return [error.message()]

    def _require_valid(self, subscription: Subscription) -> None:
        """Raise FeedError once the key of a subscription is revoked, or its token has expired."""
        authenticator, identity = self._shared.authenticator, subscription.identity
        if authenticator is not None and identity is not None and not authenticator.is_still_valid(identity):
            raise FeedError(
                Code.NOT_AUTHENTICATED, f"This subscription ends: the {identity.source} was revoked or has expired."
            )

    async def _send(self, message: dict[str, Any]) -> None:
        await self._socket.send_text(to_json(message).decode())

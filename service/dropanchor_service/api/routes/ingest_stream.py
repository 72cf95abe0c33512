"""Samples over a WebSocket: each message is a payload of the contract, and each is acknowledged.

A client that keeps a message until its acknowledgement loses nothing when the connection breaks. It may send a message
again: the numbers in the payload say that it is the same one, and it is counted as a duplicate.
"""

import asyncio
import time
from collections.abc import AsyncIterator

from starlette.websockets import WebSocket, WebSocketDisconnect

from dropanchor_schemas.answers import SamplesAcknowledged
from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id
from dropanchor_schemas.pose import Phrase
from dropanchor_schemas.sentences import said_by, say
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Rejection
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.http.access import LOOPBACK, bearer_of, client_of, identify, key_command, speaks_in
from dropanchor_service.api.http.closing import reason_of
from dropanchor_service.api.http.connections import TooManyConnectionsError
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.ingest import take_samples
from dropanchor_service.api.routes.shared_parts import shared_of
from dropanchor_service.api.routes.site_of_request import parts_of, sites_of
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.security.identity import Identity, UnauthenticatedError

PROTOCOL = "dropanchor.samples"
KEY_PROTOCOL = "dropanchor.key."
"""A browser cannot set headers of a WebSocket: it offers its key as a second protocol that begins with this."""
CONNECTIONS_PER_KEY = 8
STATE_S = 1.0  # how old the state of the tag in an acknowledgement may be

RESTART = 1012
UNREADABLE, UNAUTHENTICATED, FORBIDDEN, TOO_MANY = 4400, 4401, 4403, 4429


class _ClosedError(Exception):
    """The service ends a connection. reason: a sentence for the person."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


class _Acknowledgements:
    """Write the acknowledgements of one connection."""

    def __init__(self, answers: Answers, tag: str, started_ns: int) -> None:
        self._answers = answers
        self._tag = tag
        self._started_ns = started_ns
        self._messages = 0
        self._state_s = float("-inf")
        self._state: tuple[str | None, str] = (None, "")

    def greeting(self) -> str:
        return self._json(0)

    def of(self, taken: int | Rejection) -> str:
        self._messages += 1
        return self._json(taken)

    def _json(self, found: int | Rejection) -> str:
        self._refresh_state()
        rejection = found if isinstance(found, Rejection) else None
        return SamplesAcknowledged(
            message=self._messages,
            samples=found if isinstance(found, int) else 0,
            rejected=None if rejection is None else rejection.reason.value,
            detail="" if rejection is None else rejection.detail,
            t_ns=self._answers.now_ns(),
            started_ns=self._started_ns,
            tag=self._tag,
            state=self._state[0],
            hint=self._state[1],
            hint_phrase=Phrase.of(self._state[1]),
        ).model_dump_json()

    def _refresh_state(self) -> None:
        """Read the state of the tag again if the last reading is too old."""
        now_s = time.monotonic()
        if now_s - self._state_s < STATE_S:
            return
        self._state_s = now_s
        tag = self._answers.tags.find(self._tag)
        pose = None if tag is None else self._answers.pose_of(tag)
        self._state = (None, "") if pose is None else (pose["state"], pose["hint"])


class _Stream:
    """Serve one connection."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self._shared = shared_of(socket)
        self._authenticator = self._shared.authenticator
        self._has_several_sites = sites_of(socket).only is None
        self._key_command = key_command(self._has_several_sites)

    async def serve(self) -> None:
        """Serve an accepted connection until its end.

        Raises _ClosedError, TooManyConnectionsError and WebSocketDisconnect.
        """
        identity = await self._identity()
        tag, site = self._tag(identity), self._site(identity)
        client, answers = client_of(self._socket, identity), site.answers
        acknowledgements = _Acknowledgements(answers, tag, self._shared.started_ns)
        with (
            self._shared.sample_connections.one_more(client, CONNECTIONS_PER_KEY),
            answers.tags.presence.connected(tag),
        ):
            await self._socket.send_text(acknowledgements.greeting())
            async for payload, encoding in _messages(self._socket):
                await self._wait_for_turn(client)
                self._require_open(identity)
                taken = take_samples(site, tag, payload, encoding)
                await self._socket.send_text(acknowledgements.of(taken))

    async def _identity(self) -> Identity | None:
        if self._authenticator is None:
            return None
        secret = bearer_of(self._socket) or key_among_protocols(self._socket)
        if not secret:
            raise _ClosedError(
                UNAUTHENTICATED,
                say("needs_key", "This service needs a key. Make a key with {command}.", command=self._key_command),
            )
        try:
            return await identify(self._authenticator, secret)
        except UnauthenticatedError as error:
            raise _ClosedError(
                UNAUTHENTICATED, say("not_accepted", "Not accepted: {why}.", why=said_by(error))
            ) from error

    def _tag(self, identity: Identity | None) -> str:
        """Return the tag that a connection speaks for: that of its key, or without credentials the one it names."""
        named = self._socket.query_params.get("tag")
        own = None if identity is None else identity.tag
        if identity is not None and own is None:
            raise _ClosedError(
                FORBIDDEN,
                say(
                    "no_ingest", "This key may not send samples. Make a key with {command}.", command=self._key_command
                ),
            )
        if own is not None and named not in (None, own):
            raise _ClosedError(FORBIDDEN, say("other_tag", "This key speaks for the tag {tag} only.", tag=repr(own)))
        tag = own or named
        if tag is None:
            raise _ClosedError(UNREADABLE, say("which_tag", "Say which tag this is: add ?tag=NAME to the URL."))
        try:
            chunk_from_id(tag)
        except InvalidKeyError as error:
            raise _ClosedError(
                UNREADABLE, say("tag_name", "The tag's name cannot be used: {why}.", why=said_by(error))
            ) from error
        return tag

    def _site(self, identity: Identity | None) -> SiteParts:
        """Return the site that a connection speaks in: the one in its path, or that of its key. Raises _ClosedError."""
        if identity is not None:
            self._socket.state.site = identity.site
        try:
            site = parts_of(self._socket)
        except ProblemError as error:
            unnamed = say("which_site", "Say which site this is: add ?site=SITE to the address of the page.")
            raise _ClosedError(UNREADABLE, unnamed if error.kind is Kind.SEVERAL_SITES else error.detail) from error
        if identity is not None and not speaks_in(identity, site.id, self._has_several_sites):
            raise _ClosedError(
                FORBIDDEN,
                say(
                    "no_ingest_site",
                    "This key may not send samples to the site {site}. Make a key with {command}.",
                    site=repr(site.id),
                    command=self._key_command,
                ),
            )
        return site

    async def _wait_for_turn(self, client: str) -> None:
        """Wait until the rate limit of the client allows another message. Nothing is lost."""
        if self._shared.rate_limiter is None or (self._authenticator is None and client == LOOPBACK):
            return
        while wait_s := self._shared.rate_limiter.wait_s(client):
            await asyncio.sleep(wait_s)

    def _require_open(self, identity: Identity | None) -> None:
        """Raise _ClosedError once the service stops or the key is no longer valid."""
        if self._shared.stopping.is_set():
            raise _ClosedError(RESTART, say("stops", "The service stops. Connect again and send this message again."))
        if (
            identity is not None
            and self._authenticator is not None
            and not self._authenticator.is_still_valid(identity)
        ):
            raise _ClosedError(
                UNAUTHENTICATED,
                say(
                    "key_ended",
                    "The key was revoked or has expired. Make a key with {command}.",
                    command=self._key_command,
                ),
            )


router = Router()
"""The WebSocket. OpenAPI has no WebSockets: `reference/rest.md` describes it."""


@router.websocket("/ingest/stream")
async def ingest_stream(socket: WebSocket) -> None:
    await socket.accept(PROTOCOL if PROTOCOL in _protocols(socket) else None)
    try:
        await _Stream(socket).serve()
    except TooManyConnectionsError:
        too_many = say(
            "too_many",
            "This key has {connections} connections: end one, or make more keys.",
            connections=CONNECTIONS_PER_KEY,
        )
        await socket.close(TOO_MANY, reason_of(too_many, socket.scope))
    except _ClosedError as end:
        await socket.close(end.code, reason_of(end.reason, socket.scope))
    except WebSocketDisconnect:
        pass


async def _messages(socket: WebSocket) -> AsyncIterator[tuple[bytes, str]]:
    """Yield each payload and its encoding until the client is gone."""
    while (message := await socket.receive())["type"] == "websocket.receive":
        text = message.get("text")
        yield (message["bytes"], ENCODING_PACKED) if text is None else (text.encode(), ENCODING_JSON)


def key_among_protocols(socket: WebSocket) -> str:
    """Return the key that a browser offers; empty without one."""
    offered = (name.removeprefix(KEY_PROTOCOL) for name in _protocols(socket) if name.startswith(KEY_PROTOCOL))
    return next(offered, "")


def _protocols(socket: WebSocket) -> list[str]:
    found: list[str] = socket.scope.get("subprotocols", [])
    return found

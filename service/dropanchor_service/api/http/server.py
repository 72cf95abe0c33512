"""The HTTP server: uvicorn with additional limits."""

import asyncio
import errno
import socket
import ssl
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from threading import Event

import uvicorn
from starlette.types import ASGIApp
from uvicorn.server import ServerState

from dropanchor_service.api.http.behind_proxy import ON_THIS_MACHINE, BehindProxy
from dropanchor_service.api.http.busy_limit import BusyLimit
from dropanchor_service.api.http.limits import GuardedProtocol
from dropanchor_service.api.http.open_sockets import Listener, OpenSockets
from dropanchor_service.api.http.web_sockets import MAX_MESSAGE_BYTES, GuardedWebSocket
from dropanchor_service.runtime import open_files
from dropanchor_service.security.certificate import Certificate

GRACE_S = 1  # for open requests at shutdown; stuck clients use all of it
ACCEPTING_TURNS = 2  # of the loop, until an accepted connection is known to the server
TICK_S = 1.0  # between two dates in the answers
PING_S = 10.0  # between two pings of a WebSocket, and the time to answer one
_SEND_BUFFER_BYTES = 262_144  # how much data a client that stops reading can hold in the kernel
_MAX_HEADER_BYTES = 16_384


class ListenError(OSError):
    """The server cannot listen on the address. The message says why and what to do."""


class State(ServerState):
    """What the connections of a server share. sockets: those of its listener."""

    sockets: OpenSockets | None = None


class Server(uvicorn.Server):
    """Sets `stopping` before it waits for open requests, so that streams end, and then aborts what is left."""

    def __init__(self, config: uvicorn.Config, stopping: Event) -> None:
        super().__init__(config)
        self.server_state = self._state = State()
        self._stopping = stopping
        self._wake: Callable[[], object] = lambda: None

    def ask_to_stop(self) -> None:
        """Tell the server to shut down, without waiting. Any thread may call this."""
        self.should_exit = True
        with suppress(RuntimeError):  # the loop has ended already
            self._wake()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        listeners = [bound for bound in sockets or () if isinstance(bound, Listener)]
        self._state.sockets = listeners[0].connections if listeners else None
        await super().startup(sockets)

    async def main_loop(self) -> None:
        """Wait until the server should stop. uvicorn looks ten times a second, for a fifth of an idle service."""
        asked = asyncio.Event()
        self._wake = partial(asyncio.get_running_loop().call_soon_threadsafe, asked.set)
        while not await self.on_tick(0):  # also dates the answers
            with suppress(TimeoutError):
                await asyncio.wait_for(asked.wait(), TICK_S)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._stopping.set()
        # asyncio forgets a connection that is accepted in the moment in which its listener is closed.
        for listener in sockets or ():
            asyncio.get_running_loop().remove_reader(listener)
        for _ in range(ACCEPTING_TURNS):
            await asyncio.sleep(0)
        await super().shutdown(sockets)
        for connection in list(self.server_state.connections):
            connection.transport.abort()
        await asyncio.sleep(0)  # the loop closes the sockets in its next iteration


def build_server(
    app: ASGIApp,
    stopping: Event,
    protocol: type[GuardedProtocol] = GuardedProtocol,
    certificate: Certificate | None = None,
    trusted_proxies: Sequence[str] = ON_THIS_MACHINE,
) -> Server:
    """Return a server, to run with `await server.serve(sockets=[listen(host, port)])`.

    stopping: the event that `app` was created with. trusted_proxies: addresses and networks of proxies that say who
    the client is. Raises ListenError when the certificate cannot be used.
    """
    config = uvicorn.Config(
        BusyLimit(BehindProxy(app, trusted_proxies), open_files.shares().http),
        proxy_headers=False,
        http=protocol,
        ws=GuardedWebSocket,
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_ping_interval=PING_S,
        ws_ping_timeout=PING_S,
        ws_per_message_deflate=False,  # little to gain, and a small message may unpack to a large one
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=GRACE_S,
        h11_max_incomplete_event_size=_MAX_HEADER_BYTES,
        ssl_certfile=None if certificate is None else certificate.certificate,
        ssl_keyfile=None if certificate is None else certificate.key,
    )
    try:
        config.load()
    except (OSError, ssl.SSLError) as error:
        raise ListenError(f"cannot serve HTTPS with the certificate {config.ssl_certfile}: {error}") from error
    return Server(config, stopping)


def listen(host: str, port: int, connections: int | None = None) -> Listener:
    """Return a socket bound to this address; port 0 selects a free port. Raises ListenError.

    connections: how many may be open at a time, None: the share of HTTP in what the system allows.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except socket.gaierror as error:
        raise ListenError(f"cannot listen on {host}: {error.strerror}") from error
    bound = Listener(family, kind, protocol, open_files.shares().http if connections is None else connections)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        bound.bind(address)
    except OSError as error:
        bound.close()
        raise ListenError(f"cannot listen on {host} port {port}: {_cause(error)}") from error
    return bound


def _cause(error: OSError) -> str:
    match error.errno:
        case errno.EADDRINUSE:
            return "another program uses it; stop that one or choose another port"
        case errno.EACCES:
            return "ports below 1024 are reserved; choose a higher one"
        case errno.EADDRNOTAVAIL:
            return "this machine does not have the address"
    return error.strerror or str(error)

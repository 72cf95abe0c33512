"""Run the real HTTP server on loopback, in a thread."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

from starlette.types import ASGIApp

from dropanchor_service.api.http.limits import GuardedProtocol
from dropanchor_service.api.http.server import build_server, listen
from dropanchor_service.security.certificate import Certificate
from support.patience import PATIENCE_S
from support.zenoh_router import wait_until


@contextmanager
def running_server(
    app: ASGIApp,
    stopping: Event,
    port: int = 0,
    protocol: type[GuardedProtocol] = GuardedProtocol,
    certificate: Certificate | None = None,
) -> Iterator[int]:
    """Serve the app on loopback until the block ends. Yield the port."""
    socket = listen("127.0.0.1", port)
    server = build_server(app, stopping, protocol, certificate)
    thread = Thread(target=lambda: asyncio.run(server.serve(sockets=[socket])))
    thread.start()
    wait_until(lambda: server.started)
    try:
        yield socket.getsockname()[1]
    finally:
        server.ask_to_stop()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
        socket.close()

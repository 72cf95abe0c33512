"""Clients over TLS that do not read their last response, while the server stops."""

import asyncio
import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from dropanchor_service.api.http.limits import GuardedProtocol
from dropanchor_service.api.http.server import Server, build_server, listen
from dropanchor_service.security.certificate import Certificate
from support.certificate import self_signed
from support.patience import PATIENCE_S
from support.zenoh_router import wait_until

REQUEST = b"GET / HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n"


class PatientUntilShutdown(GuardedProtocol):
    stalled_s = 3600.0


@dataclass
class TlsServer:
    """port: where it listens. errors: what the loop reported."""

    server: Server
    port: int
    errors: list[dict[str, Any]] = field(default_factory=list)

    @property
    def protocols(self) -> list[GuardedProtocol]:
        return [one for one in self.server.server_state.connections if isinstance(one, GuardedProtocol)]


async def large_response(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer with more than the kernel and the client take."""
    await Response(bytes(20_000_000))(scope, receive, send)


@contextmanager
def serving(folder: Path, protocol: type[GuardedProtocol] = GuardedProtocol) -> Iterator[TlsServer]:
    """Run a server with TLS. After the block it has stopped."""
    certificate, key = self_signed(folder)
    server = build_server(large_response, Event(), protocol, Certificate(certificate, key))
    bound = listen("127.0.0.1", 0)
    found = TlsServer(server, int(bound.getsockname()[1]))

    async def serve() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: found.errors.append(context))
        await server.serve(sockets=[bound])

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    wait_until(lambda: server.started)
    try:
        yield found
    finally:
        server.ask_to_stop()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


@contextmanager
def stuck_client(served: TlsServer) -> Iterator[None]:
    """Ask for the response, and do not read it once the server waits for its client."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    plain = socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE_S)
    with closing(context.wrap_socket(plain)) as client:
        client.sendall(REQUEST)
        wait_until(lambda: any(one.transport.is_closing() for one in served.protocols))
        yield


def test_a_server_stops_in_time_with_a_client_that_does_not_read_its_last_response(tmp_path: Path) -> None:
    with serving(tmp_path, PatientUntilShutdown) as served, stuck_client(served):
        served.server.ask_to_stop()
        wait_until(lambda: not served.protocols)
    assert served.errors == []


def test_a_connection_that_was_closed_twice_is_left_alone(tmp_path: Path) -> None:
    with serving(tmp_path, PatientUntilShutdown) as served, stuck_client(served):
        [protocol] = served.protocols
        protocol.loop.call_soon_threadsafe(protocol.transport.close)
        fired = threading.Event()
        protocol.loop.call_soon_threadsafe(protocol._cut_if_stalled, 0)  # as its timer does
        protocol.loop.call_soon_threadsafe(fired.set)
        assert fired.wait(PATIENCE_S)
        assert served.errors == []

"""A real uvicorn on loopback, and clients that misbehave."""

import asyncio
import gc
import socket
import time
from contextlib import closing
from threading import Event
from typing import Any

import pytest
from starlette.types import Receive, Scope, Send
from websockets.asyncio.client import connect

from dropanchor_service.api.app import MAX_BODY_BYTES
from dropanchor_service.api.http.limits import GuardedProtocol
from dropanchor_service.api.http.open_sockets import Listener
from dropanchor_service.api.http.server import ListenError, build_server, listen
from support.api import make_api_bench
from support.event_stream import get, serving, streaming
from support.patience import PATIENCE_S


class ShortDeadlines(GuardedProtocol):
    request_s = 0.5
    stalled_s = 0.5


class LongDeadlines(GuardedProtocol):
    request_s = 2.0
    stalled_s = 2.0


class EndlessDeadlines(GuardedProtocol):
    stalled_s = PATIENCE_S


def _connected(port: int, *sent: bytes) -> socket.socket:
    client = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
    for data in sent:
        client.sendall(data)
    return client


def _answer(client: socket.socket) -> bytes:
    """Return head and body of a JSON response, which may arrive in several pieces."""
    answer = b""
    while not answer.endswith(b"}"):
        received = client.recv(65536)
        assert received, f"the connection has ended after {answer!r}"
        answer += received
    return answer


def _ended(client: socket.socket) -> bool:
    """Read until the server has closed the connection; fail when it stays open."""
    end_s = time.monotonic() + PATIENCE_S
    try:
        while client.recv(65536):
            assert time.monotonic() < end_s, "the connection is still open"
    except ConnectionResetError:
        pass
    return True


def test_the_server_stops_with_a_stuck_stream() -> None:
    bench = make_api_bench()
    bench.move(*(f"tag-{number}" for number in range(2000)))
    with serving(bench) as port:
        client = _connected(port, b"GET /api/v1/stream?max_hz=30 HTTP/1.1\r\nhost: x\r\n\r\n")
        for _ in range(10):
            bench.move(*(f"tag-{number}" for number in range(2000)))
            time.sleep(0.05)
    client.close()


@pytest.mark.parametrize("guard", [EndlessDeadlines, ShortDeadlines])
def test_a_client_that_stops_reading_does_not_delay_others_and_is_disconnected_in_the_end(
    guard: type[GuardedProtocol],
) -> None:
    bench = make_api_bench()
    names = [f"tag-{number}" for number in range(2000)]
    bench.move(*names)
    with serving(bench, guard) as port, streaming(port) as events:
        next(events)
        with closing(_connected(port, b"GET /api/v1/stream?max_hz=30 HTTP/1.1\r\nhost: x\r\n\r\n")) as stuck:
            for _ in range(15):
                bench.move(*names)
                next(events)
            if guard is ShortDeadlines:
                received = stuck.recv(2**26, socket.MSG_WAITALL)
                assert received.startswith(b"HTTP/1.1 200")
                assert _ended(stuck)


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"G",
        b"GET /api/v1/health/live HTTP/1.1\r\nhost:",
        b"PUT /api/v1/site HTTP/1.1\r\nhost: x\r\ncontent-type: application/json\r\ncontent-length: 9\r\n\r\n{",
    ],
)
def test_an_incomplete_request_is_disconnected(sent: bytes) -> None:
    with serving(make_api_bench(), ShortDeadlines) as port:
        clients = [_connected(port, sent) for _ in range(50)]
        assert get(port).status_code == 200
        assert all(_ended(client) for client in clients)
        for client in clients:
            client.close()


def test_an_incomplete_second_request_is_disconnected_too() -> None:
    with (
        serving(make_api_bench(), ShortDeadlines) as port,
        closing(_connected(port, b"GET /api/v1/health/live HTTP/1.1\r\nhost: x\r\n\r\n")) as client,
    ):
        assert _answer(client).startswith(b"HTTP/1.1 200")
        client.sendall(b"G")
        assert _ended(client)


def test_a_slow_but_complete_request_and_a_long_stream_are_served() -> None:
    bench = make_api_bench()
    with serving(bench, LongDeadlines) as port, streaming(port) as events:
        next(events)
        request = b"GET /api/v1/health/live HTTP/1.1\r\nhost: x\r\n\r\n"
        client = _connected(port, request[:20])
        time.sleep(0.3)
        client.sendall(request[20:])
        with closing(client):
            assert _answer(client).startswith(b"HTTP/1.1 200")
            time.sleep(2.1)
            client.sendall(request)
            assert _answer(client).startswith(b"HTTP/1.1 200")
        bench.move("a")
        assert next(events)[1]["tags"] == ["a"]


def test_a_large_body_may_take_longer_than_the_deadline_while_it_comes_fast_enough() -> None:
    piece, pieces = b"\0" * 300_000, 5
    head = f"POST /api/v1/plan-images HTTP/1.1\r\nhost: x\r\ncontent-length: {pieces * len(piece)}\r\n\r\n"
    with serving(make_api_bench(), LongDeadlines) as port, closing(_connected(port, head.encode())) as client:
        for _ in range(pieces):
            time.sleep(0.3 * LongDeadlines.request_s)
            client.sendall(piece)
        assert _answer(client).startswith(b"HTTP/1.1 422")


def test_a_large_body_is_refused_by_its_content_length() -> None:
    head = f"PUT /api/v1/site HTTP/1.1\r\nhost: x\r\ncontent-length: {MAX_BODY_BYTES + 1}\r\n\r\n"
    with serving(make_api_bench()) as port, closing(_connected(port, head.encode())) as client:
        answer = _answer(client)
        assert answer.startswith(b"HTTP/1.1 413")
        assert b"application/problem+json" in answer


def test_the_server_survives_junk_and_endless_headers() -> None:
    with serving(make_api_bench()) as port:
        for sent in (b"\x16\x03\x01" * 100, b"GET / HTTP/1.1\r\n" + b"x: y\r\n" * 20_000):
            with closing(_connected(port, sent)) as client:
                assert _ended(client)
        assert get(port).status_code == 200


def test_a_port_in_use_is_explained() -> None:
    with closing(listen("127.0.0.1", 0)) as first:
        first.listen()
        with pytest.raises(ListenError, match="another program uses it"):
            listen("127.0.0.1", first.getsockname()[1])


def test_an_address_of_another_machine_is_explained() -> None:
    with pytest.raises(ListenError, match="does not have the address"):
        listen("192.0.2.1", 0)


async def _app_without_a_page(_scope: Scope, _receive: Receive, _send: Send) -> None: ...


def test_a_connection_that_is_accepted_while_the_server_stops_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    bound, accept = listen("127.0.0.1", 0), Listener.accept
    server = build_server(_app_without_a_page, Event())

    async def serve_until_the_first() -> None:
        accepted = asyncio.Event()

        def accept_and_stop(listener: Listener) -> tuple[socket.socket, Any]:
            opened = accept(listener)
            accepted.set()  # wakes the server before asyncio makes a transport of what it has accepted
            return opened

        monkeypatch.setattr(Listener, "accept", accept_and_stop)
        monkeypatch.setattr(server, "main_loop", accepted.wait)
        await server.serve(sockets=[bound])

    bound.listen()
    with _connected(bound.getsockname()[1]) as client:
        asyncio.run(serve_until_the_first())
        assert _ended(client)
    gc.collect()  # warns of a transport that nobody closed


def test_a_web_socket_that_its_client_has_just_ended_can_be_shut_down() -> None:
    bound = listen("127.0.0.1", 0)
    shut_down: list[int] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "websocket":
            return
        await receive()
        await send({"type": "websocket.accept"})
        message = await receive()
        assert message["type"] == "websocket.disconnect"
        try:
            for connection in list(server.server_state.connections):  # as the server does when it is asked to stop now
                connection.shutdown()
                shut_down.append(message["code"])
        finally:
            server.ask_to_stop()

    server = build_server(app, Event())

    async def talk() -> None:
        serving = asyncio.create_task(server.serve(sockets=[bound]))
        async with connect(f"ws://127.0.0.1:{bound.getsockname()[1]}", proxy=None):
            pass
        await serving

    bound.listen()
    asyncio.run(talk())
    assert shut_down == [1000]

"""Connections are bounded: silent ones make room for new ones, and health checks are answered all the same."""

import asyncio
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack, contextmanager
from threading import Event

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from support.http_server import running_server

LIMIT = 8


def app(stopping: Event) -> Starlette:
    async def answer(_: Request) -> Response:
        return PlainTextResponse("here")

    async def stream(_: Request) -> Response:
        async def lines() -> AsyncIterator[str]:
            while not stopping.is_set():
                yield "data\n"
                await asyncio.sleep(0.05)

        return StreamingResponse(lines())

    return Starlette(routes=[Route("/", answer), Route("/health/live", answer), Route("/stream", stream)])


@contextmanager
def silent(port: int, count: int, text: bytes = b"") -> Iterator[list[socket.socket]]:
    with ExitStack() as stack:
        clients = [stack.enter_context(socket.create_connection(("127.0.0.1", port), 60.0)) for _ in range(count)]
        for client in clients:
            client.sendall(text)
        yield clients


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    monkeypatch.setattr("dropanchor_service.runtime.open_files.MOST", LIMIT)
    stopping = Event()
    with running_server(app(stopping), stopping) as port:
        yield port


def get(port: int, path: str = "/") -> int:
    return httpx.get(f"http://127.0.0.1:{port}{path}", trust_env=False, verify=False).status_code


def test_silent_connections_are_closed_for_new_ones(port: int) -> None:
    with silent(port, 10 * LIMIT) as clients:
        assert [get(port) for _ in range(20)] == [200] * 20
        assert clients[0].recv(1) == b""


def test_a_connection_that_was_answered_may_be_closed_for_a_new_one(port: int) -> None:
    with silent(port, LIMIT, b"GET / HTTP/1.1\r\nhost: a\r\n\r\n") as clients:
        for client in clients:
            assert client.recv(12) == b"HTTP/1.1 200"
        assert get(port) == 200


def test_streams_leave_connections_for_health_checks(port: int) -> None:
    streams = int(0.75 * LIMIT)
    with silent(port, streams, b"GET /stream HTTP/1.1\r\nhost: a\r\n\r\n") as clients:
        for client in clients:
            assert client.recv(12) == b"HTTP/1.1 200"
        assert get(port) == 503
        assert get(port, "/health/live") == 200
        assert clients[0].recv(1)

"""A real uvicorn on loopback: the stream, and clients that misbehave."""

import asyncio
import json
import socket
import statistics
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import httpx
import pytest

from dropanchor_schemas.pose import PoseFrame
from dropanchor_service.api.app import MAX_BODY_BYTES
from dropanchor_service.api.http.limits import GuardedProtocol
from dropanchor_service.api.http.server import ListenError, build_server, listen
from dropanchor_service.api.routes import stream
from support.api import ApiBench, kind_of, make_api_bench

TIMEOUT_S = 10.0


class ShortDeadlines(GuardedProtocol):
    request_s = 0.5
    stalled_s = 0.5


class LongDeadlines(GuardedProtocol):
    request_s = 2.0
    stalled_s = 2.0


@contextmanager
def serving(bench: ApiBench, protocol: type[GuardedProtocol] = GuardedProtocol) -> Iterator[int]:
    """Run a server and yield its port. The server and its streams have ended after the block."""
    server = build_server(bench.app(), bench.stopping, protocol)
    bound = listen("127.0.0.1", 0)
    port = int(bound.getsockname()[1])
    thread = threading.Thread(target=lambda: asyncio.run(server.serve(sockets=[bound])))
    thread.start()
    try:
        _wait_for(lambda: server.started)
        yield port
    finally:
        server.should_exit = True
        thread.join(TIMEOUT_S)
    assert not thread.is_alive()


@contextmanager
def streaming(port: int, query: str = "max_hz=30") -> Iterator[Iterator[tuple[str, Any]]]:
    """Open a stream and yield its events: name and frame. A comment has an empty name."""
    url = f"http://127.0.0.1:{port}/api/v1/stream?{query}"
    with httpx.Client(timeout=TIMEOUT_S, trust_env=False) as client, client.stream("GET", url) as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        yield _events(response)


def _events(response: httpx.Response) -> Iterator[tuple[str, Any]]:
    name = ""
    for line in response.iter_lines():
        if line.startswith("event: "):
            name = line[7:]
        elif line.startswith("data: "):
            yield name, json.loads(line[6:])
        elif line.startswith(":"):
            yield "", line


def _wait_for(condition: Any) -> None:
    end_s = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < end_s, "the condition did not become true in time"
        time.sleep(0.01)


def _get(port: int, path: str = "/api/v1/health/live") -> httpx.Response:
    return httpx.get(f"http://127.0.0.1:{port}{path}", timeout=TIMEOUT_S, trust_env=False)


def _connected(port: int, *sent: bytes) -> socket.socket:
    client = socket.create_connection(("127.0.0.1", port), timeout=TIMEOUT_S)
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
    end_s = time.monotonic() + TIMEOUT_S
    try:
        while client.recv(65536):
            assert time.monotonic() < end_s, "the connection is still open"
    except ConnectionResetError:
        pass
    return True


def test_a_stream_starts_with_all_tags_and_continues_with_changes() -> None:
    bench = make_api_bench()
    bench.move("a", "b", x=1.0)
    with serving(bench) as port, streaming(port) as events:
        name, frame = next(events)
        assert (name, frame["tags"], frame["x"]) == ("snapshot", ["a", "b"], [1.0, 1.0])
        PoseFrame.model_validate(frame)
        bench.move("b", x=2.0)
        name, frame = next(events)
        assert (name, frame["tags"], frame["x"]) == ("poses", ["b"], [2.0])
        bench.move("c", x=3.0)
        assert next(events)[1]["tags"] == ["c"]


def test_a_stream_without_poses_starts_with_an_empty_snapshot() -> None:
    with serving(make_api_bench()) as port, streaming(port) as events:
        name, frame = next(events)
        assert (name, frame["tags"]) == ("snapshot", [])


def test_a_stream_of_selected_tags_includes_those_that_appear_later() -> None:
    bench = make_api_bench()
    bench.move("a", "b")
    with serving(bench) as port, streaming(port, "max_hz=30&tags=b,late") as events:
        assert next(events)[1]["tags"] == ["b"]
        bench.move("a")
        bench.move("late")
        assert next(events)[1]["tags"] == ["late"]


def test_a_client_gets_the_newest_poses_at_no_more_than_its_rate() -> None:
    bench = make_api_bench()
    bench.move("a", x=0.0)
    with serving(bench) as port, streaming(port, "max_hz=5") as events:
        next(events)
        start_s = time.monotonic()
        seen: list[float] = []
        for count in range(1, 101):
            bench.move("a", x=float(count))
            time.sleep(0.01)
        while not seen or seen[-1] != 100.0:
            seen.append(next(events)[1]["x"][0])
        assert len(seen) <= (time.monotonic() - start_s) * 5 + 1
        assert seen == sorted(set(seen))


def test_a_tag_that_falls_silent_or_goes_offline_is_reported_without_a_new_pose() -> None:
    bench = make_api_bench()
    bench.move("a", "b")
    bench.answers.tags.presence.set_token("b", True)
    with serving(bench) as port, streaming(port) as events:
        assert next(events)[1]["online"] == [False, True]
        bench.answers.tags.presence.set_token("b", False)
        frame = next(events)[1]
        assert (frame["tags"], frame["online"]) == (["b"], [False])
        bench.now_ns += 2_000_000_000
        assert next(events)[1]["state"] == ["coasting", "coasting"]


def test_a_quiet_stream_sends_heartbeats(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "HEARTBEAT_S", 0.1)
    with serving(make_api_bench()) as port, streaming(port) as events:
        next(events)
        assert next(events) == ("", ": alive")


@pytest.mark.parametrize("query", ["max_hz=nan", "max_hz=inf", "max_hz=0.09", "max_hz=30.1", "max_hz=fast", "hz=1"])
def test_invalid_stream_parameters_are_a_problem(query: str) -> None:
    with serving(make_api_bench()) as port:
        assert kind_of(_get(port, f"/api/v1/stream?{query}")) == "invalid-request"


def test_streams_end_when_the_server_stops() -> None:
    bench = make_api_bench()
    with serving(bench) as port, streaming(port, "max_hz=0.1") as events:
        next(events)
        bench.stopping.set()
        start_s = time.monotonic()
        assert list(events) == []
        assert time.monotonic() - start_s < 8.0


def test_the_server_stops_in_time_with_a_stuck_stream() -> None:
    bench = make_api_bench()
    bench.move(*(f"tag-{number}" for number in range(2000)))
    with serving(bench) as port:
        client = _connected(port, b"GET /api/v1/stream?max_hz=30 HTTP/1.1\r\nhost: x\r\n\r\n")
        for _ in range(10):
            bench.move(*(f"tag-{number}" for number in range(2000)))
            time.sleep(0.05)
        start_s = time.monotonic()
    assert time.monotonic() - start_s < 20.0
    client.close()


def test_a_client_that_stops_reading_is_disconnected_and_does_not_delay_others() -> None:
    bench = make_api_bench()
    names = [f"tag-{number}" for number in range(2000)]
    bench.move(*names)
    with serving(bench, ShortDeadlines) as port, streaming(port) as events:
        next(events)
        stuck = _connected(port, b"GET /api/v1/stream?max_hz=30 HTTP/1.1\r\nhost: x\r\n\r\n")
        gaps_s, end_s = [], time.monotonic() + 3.0
        while time.monotonic() < end_s:
            bench.move(*names)
            start_s = time.monotonic()
            next(events)
            gaps_s.append(time.monotonic() - start_s)
        assert statistics.median(gaps_s) < 2.0
        with closing(stuck):
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
        assert _get(port).status_code == 200
        start_s = time.monotonic()
        assert all(_ended(client) for client in clients)
        assert time.monotonic() - start_s < 30.0
        for client in clients:
            client.close()


def test_an_incomplete_second_request_is_disconnected_too() -> None:
    with (
        serving(make_api_bench(), ShortDeadlines) as port,
        closing(_connected(port, b"GET /api/v1/health/live HTTP/1.1\r\nhost: x\r\n\r\n")) as client,
    ):
        assert _answer(client).startswith(b"HTTP/1.1 200")
        start_s = time.monotonic()
        client.sendall(b"G")
        assert _ended(client)
        assert time.monotonic() - start_s < 30.0


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
        assert _get(port).status_code == 200


def test_a_port_in_use_is_explained() -> None:
    with closing(listen("127.0.0.1", 0)) as first:
        first.listen()
        with pytest.raises(ListenError, match="another program uses it"):
            listen("127.0.0.1", first.getsockname()[1])


def test_an_address_of_another_machine_is_explained() -> None:
    with pytest.raises(ListenError, match="does not have the address"):
        listen("192.0.2.1", 0)

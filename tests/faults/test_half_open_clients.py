"""Clients that connect and send nothing harm no other client of a real service.

Streams that a client does not read are tested in `tests/service/api/http/test_server.py`.
"""

import os
import resource
import socket
import statistics
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import cycle
from pathlib import Path

import httpx

from support.secured import secured_site
from support.service import Running, running_service
from support.zenoh_router import connected_session

HTTP_SOCKETS = int(os.environ.get("DROPANCHOR_SILENT_HTTP", "200"))
ZENOH_SOCKETS = int(os.environ.get("DROPANCHOR_SILENT_ZENOH", "100"))
"""The figures in service/docs/results/survives.md are for 1,000 and 300. `pytest -s` prints them."""

TIMEOUT_S = 60.0


@contextmanager
def half_open(port: int, count: int, *payloads: bytes) -> Iterator[list[socket.socket]]:
    """Open `count` connections and send one of the payloads, in turn, on each."""
    with ExitStack() as opened:
        clients = []
        for _, payload in zip(range(count), cycle(payloads), strict=False):
            clients.append(opened.enter_context(socket.create_connection(("127.0.0.1", port), TIMEOUT_S)))
            clients[-1].sendall(payload)
        yield clients


def http_port(service: Running) -> int:
    return int(service.url.rpartition(":")[2])


def timed_requests(service: Running, count: int) -> list[float]:
    """Return the response time of each request in s. All of them must succeed."""
    durations_s = []
    with httpx.Client(base_url=service.url, timeout=TIMEOUT_S, trust_env=False, verify=False) as client:
        for _ in range(count):
            begun = time.monotonic()
            assert client.get("/api/v1/poses").status_code == 200
            durations_s.append(time.monotonic() - begun)
    return durations_s


def print_times(name: str, seconds: list[float]) -> None:
    ordered = sorted(seconds)
    p99 = ordered[int(0.99 * (len(ordered) - 1))]
    times = f"median {statistics.median(ordered):.4f} s, p99 {p99:.4f} s, worst {ordered[-1]:.4f} s"
    print(f"{name}: {times}")  # noqa: T201


def are_closed(clients: list[socket.socket]) -> bool:
    try:
        return all(client.recv(65536) == b"" for client in clients)
    except ConnectionResetError:
        return True


def test_silent_http_connections_block_no_other_client_and_are_closed() -> None:
    payloads = (b"", b"G", b"GET /api/v1/poses HTTP/1.1\r\nhost:")
    with running_service() as service, half_open(http_port(service), HTTP_SOCKETS, *payloads) as clients:
        print_times(f"REST beside {HTTP_SOCKETS} silent sockets", timed_requests(service, 300))
        assert are_closed(clients)
        assert service.stop() == 0


def test_connections_without_a_tls_handshake_block_no_other_client_and_are_closed(tmp_path: Path) -> None:
    site = secured_site(tmp_path / "security")
    arguments = ("--security", str(site.folder.path), "--zenoh-connect", site.endpoint)
    with (
        running_service(*arguments, ready=False, ca=site.folder.certificate("ca")) as service,
        half_open(http_port(service), HTTP_SOCKETS, b"", b"\x16\x03") as clients,
    ):
        for _ in range(20):
            assert service.ask("GET", "/api/v1/health/live").status_code == 200
        assert are_closed(clients)


def test_silent_zenoh_connections_block_no_tag() -> None:
    with running_service() as service:
        with half_open(int(service.zenoh.rpartition(":")[2]), ZENOH_SOCKETS, b"", b"\x00"):
            opened = []
            for _ in range(20):
                begun = time.monotonic()
                with connected_session(service.zenoh) as session:
                    opened.append(time.monotonic() - begun)
                    assert session.info.routers_zid()
            print_times(f"Zenoh open beside {ZENOH_SOCKETS} silent sockets", opened)
        assert service.stop() == 0


def test_the_service_raises_its_limit_of_open_files_to_the_hard_limit() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(1024, hard), hard))
    try:
        with running_service(forked=False) as service:
            assert resource.prlimit(service.process.pid, resource.RLIMIT_NOFILE) == (hard, hard)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))

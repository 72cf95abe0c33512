"""A process without files, and clients that take connections, stop neither checkpoints nor health checks."""

import socket
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import httpx
import pytest
import zenoh

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, RangeSample, encode_packed
from support import service as services
from support.service import Running, running_service
from support.zenoh_router import connected_session, wait_until

FILES = 128
CLIENTS = 200
WRITTEN = 'dropanchor_checkpoints_total{outcome="written"}'
SOCKET = (  # a tag without a name: the service ends this WebSocket, and the client never answers
    b"GET /api/v1/ingest/stream HTTP/1.1\r\nhost: 127.0.0.1\r\nupgrade: websocket\r\nconnection: upgrade\r\n"
    b"sec-websocket-key: dGhlIHNhbXBsZSBub25jZQ==\r\nsec-websocket-version: 13\r\n\r\n"
)
STREAM = b"GET /api/v1/stream HTTP/1.1\r\nhost: 127.0.0.1\r\n\r\n"


@pytest.fixture
def few_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let services that are started open few files."""

    def command(*arguments: str) -> list[str]:
        limited = ["sh", "-c", f'ulimit -n {FILES}; exec "$@"', "sh"]
        return [*limited, sys.executable, "-m", "dropanchor_service", *arguments]

    monkeypatch.setattr(services, "command", command)


@contextmanager
def clients(address: str, text: bytes = b"") -> Iterator[None]:
    """Keep connections open that send this and read nothing."""
    host, _, port = address.rpartition("/")[2].rpartition(":")
    with ExitStack() as stack:
        for _ in range(CLIENTS):
            client = stack.enter_context(socket.create_connection((host, int(port)), 60.0))
            client.sendall(text)
        yield


def check_beside(service: Running, session: zenoh.Session, address: str, text: bytes = b"") -> None:
    """Check health checks, checkpoints and the length of the log while clients hold connections to the address."""
    written, lines = service.metric(WRITTEN), len(service.log)

    def is_written() -> bool:
        frame = Frame(ranges=[RangeSample(time.time_ns(), 7, 5.0)])
        session.put(samples_key("default", "a"), encode_packed(frame), encoding=ENCODING_PACKED)
        return service.metric(WRITTEN) > written + 2

    with clients(address, text):
        for _ in range(20):
            assert httpx.get(f"{service.url}/api/v1/health/ready", trust_env=False, verify=False).status_code == 200
            time.sleep(0.05)
        wait_until(is_written)
    assert service.metric('dropanchor_checkpoints_total{outcome="failed"}') == 0
    assert len(service.log) <= lines + 20


@pytest.mark.usefixtures("few_files")
@pytest.mark.parametrize(
    "text", [b"", STREAM, SOCKET], ids=["silent", "streams that are not read", "ended web sockets"]
)
def test_clients_that_hold_connections_stop_neither_health_checks_nor_checkpoints(tmp_path: Path, text: bytes) -> None:
    config = tmp_path / "dropanchor.toml"
    config.write_text("checkpoint_s = 0.2\n")
    with (
        running_service("--config", str(config), "--data-dir", str(tmp_path / "data")) as service,
        connected_session(service.zenoh) as session,
    ):
        check_beside(service, session, service.url, text)
        wait_until(lambda: service.ask("GET", "/api/v1/poses").status_code == 200)


@pytest.mark.usefixtures("few_files")
def test_silent_zenoh_connections_stop_neither_health_checks_nor_checkpoints(tmp_path: Path) -> None:
    config = tmp_path / "dropanchor.toml"
    config.write_text("checkpoint_s = 0.2\n")
    with (
        running_service("--config", str(config), "--data-dir", str(tmp_path / "data")) as service,
        connected_session(service.zenoh) as session,
    ):
        check_beside(service, session, service.zenoh)
        with connected_session(service.zenoh) as another:
            assert another.info.routers_zid()

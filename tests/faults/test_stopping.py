"""SIGTERM ends the service at once with a last checkpoint, whatever clients are stuck and whatever arrives."""

import logging
import socket
import time
from contextlib import ExitStack
from pathlib import Path

from support.live_tags import LiveTags, is_current, samples_of
from support.service import running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

TAGS, SEED, STUCK = 3, 6, 20
NEVER_READS = b"GET /api/v1/stream HTTP/1.1\r\nHost: a\r\n\r\n"

_log = logging.getLogger(__name__)


def open_stuck_clients(opened: ExitStack, address: str, sent: bytes) -> None:
    """Open connections that send something and then neither read nor write."""
    host, _, port = address.rpartition(":")
    for _ in range(STUCK):
        client = opened.enter_context(socket.create_connection((host, int(port))))
        client.sendall(sent)


def test_a_signal_ends_a_busy_service_with_stuck_clients_without_loss(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    tags = LiveTags(endpoint, TAGS, SEED, cache_messages=6000)
    config = tags.write_settings(tmp_path, "checkpoint_s = 3600")  # only a first one and the one at the end are written
    options = ("--config", str(config), "--data-dir", str(tmp_path / "data"), "--zenoh-connect", endpoint)
    with router_process(endpoint):
        with tags, running_service(*options) as service, ExitStack() as opened:
            wait_until(lambda: is_current(service, TAGS))
            address = service.url.removeprefix("http://")
            for sent in (NEVER_READS, b"GET /api/v1/poses HTTP/1.1\r\nHost:", b""):
                open_stuck_clients(opened, address, sent)
            open_stuck_clients(opened, endpoint.removeprefix("tcp/"), b"")
            before = samples_of(service)
            asked_s = time.monotonic()
            assert service.stop() == 0
            _log.info("The service stopped after %.2f s.", time.monotonic() - asked_s)
            assert "Traceback" not in "".join(service.log)
        with running_service(*options) as service:  # restored from the checkpoint alone, without tags and their caches
            after = samples_of(service)
    assert after.keys() == before.keys()
    assert all(after[tag][kind] >= count for tag, counts in before.items() for kind, count in counts.items())
    assert len(list((tmp_path / "data" / "checkpoints").iterdir())) <= 6  # two whole ones, two that continue each

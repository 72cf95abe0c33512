"""A tag that is killed in an outage longer than its memory: after both, the service has used each sample once."""

from pathlib import Path

from dropanchor_schemas.wire import Frame, decode_packed
from support.commands import start_python
from support.service import running_service
from support.zenoh_router import free_endpoint, start_router_process, wait_until

PUBLISH = """
import sys, time
from dropanchor_tag_client import TagClient
count = 0
with TagClient("a", connect=sys.argv[1], spool=sys.argv[2], cache_messages=60, batch_samples=2, batch_s=None) as tag:
    for _ in sys.stdin:
        for _ in range(100):
            tag.publish_range(7, 10.0)
            time.sleep(0.005)
        tag.flush()
        count += 100
        print(count, flush=True)
"""


class PublishingTag:
    """A process that publishes 100 ranges at a time."""

    def __init__(self, endpoint: str, spool: Path) -> None:
        self._process = start_python("-c", PUBLISH, endpoint, str(spool))

    def publish(self, times: int) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        for _ in range(times):
            self._process.stdin.write("\n")
            self._process.stdin.flush()
            assert self._process.stdout.readline().strip()

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()


def last_number_on_disk(folder: Path) -> int | None:
    """Return the number of the newest message in the spool. Each has two ranges, and is the end of its record."""
    newest = max(folder.rglob("*.spool"), default=None)
    frame = None if newest is None else decode_packed(newest.read_bytes()[-64:])
    return frame.sequence if isinstance(frame, Frame) else None


def test_a_long_outage_with_a_killed_tag_loses_no_sample_and_uses_none_twice(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    router = start_router_process(endpoint)
    tag = PublishingTag(endpoint, tmp_path)
    try:
        with running_service("--zenoh-connect", endpoint) as service:

            def used() -> int:
                return int(service.metric('dropanchor_samples_total{kind="range"}'))

            tag.publish(2)
            wait_until(lambda: used() == 200)
            router.kill()
            router.communicate()
            tag.publish(6)  # 300 messages, while the cache holds 60
            wait_until(lambda: last_number_on_disk(tmp_path) == 399)
            tag.kill()
            tag = PublishingTag(endpoint, tmp_path)
            tag.publish(2)
            router = start_router_process(endpoint)
            tag.publish(2)
            wait_until(lambda: used() >= 1200)
            tag.publish(1)
            wait_until(lambda: used() >= 1300)
            assert service.get("/api/v1/tags/a")["samples"] == {"range": 1300}
            assert service.metric("dropanchor_missed_messages_total") == 0
            assert service.metric('dropanchor_rejected_total{reason="late"}') == 0
    finally:
        tag.kill()
        router.kill()
        router.communicate()

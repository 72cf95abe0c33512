"""The background writer writes queued items and survives full disks and bugs."""

from collections.abc import Sequence

import pytest

from dropanchor_service.runtime.background_writer import BackgroundWriter
from support.zenoh_router import wait_until


class Disk:
    """Collects the items, or raises `error`."""

    def __init__(self) -> None:
        self.items: list[int] = []
        self.error: Exception | None = None

    def write(self, items: Sequence[int]) -> None:
        if self.error is not None:
            raise self.error
        self.items.extend(items)


def test_items_are_written_in_order_and_the_rest_when_it_stops() -> None:
    disk = Disk()
    writer = BackgroundWriter("test", disk.write, 0.01, 1000)
    writer.start()
    for item in range(5):
        writer.put(item, 1)
    wait_until(lambda: disk.items == [0, 1, 2, 3, 4])
    writer.stop()
    assert not writer.is_alive
    slow = BackgroundWriter("test", disk.write, 3600.0, 1000)
    slow.start()
    slow.put(5, 1)
    slow.stop()
    assert disk.items == [0, 1, 2, 3, 4, 5]


def test_on_a_full_disk_only_items_beyond_the_queue_are_dropped() -> None:
    disk = Disk()
    disk.error = OSError(28, "No space left on device")
    writer = BackgroundWriter("test", disk.write, 0.01, 100)
    writer.put(0, 50, count=7)
    assert not writer.flush()
    assert "No space left" in (writer.problem or "")
    writer.put(1, 50, count=7)
    writer.put(2, 50, count=7)
    assert (writer.dropped, writer.queued_bytes) == (7, 100)
    disk.error = None
    assert writer.flush()
    assert disk.items == [0, 1]
    assert (writer.problem, writer.errors, writer.queued_bytes) == (None, 1, 0)


def test_a_bug_in_write_drops_its_items_but_does_not_end_the_thread() -> None:
    disk = Disk()
    disk.error = ZeroDivisionError("a bug")
    writer = BackgroundWriter("test", disk.write, 0.01, 1000)
    writer.start()
    writer.put(0, 1, count=3)
    wait_until(lambda: writer.dropped == 3)
    disk.error = None
    writer.put(1, 1)
    wait_until(lambda: disk.items == [1])
    assert writer.is_alive
    writer.stop()


def test_a_write_that_does_not_return_is_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str | None] = []
    monkeypatch.setattr("dropanchor_service.runtime.background_writer.STUCK_S", 0.0)
    writer: BackgroundWriter[int] = BackgroundWriter("test", lambda _: seen.append(writer.problem), 3600.0, 1000)
    assert writer.flush()
    assert seen == ["test cannot be written: the disk has not answered for more than 0 s"]
    assert writer.problem is None

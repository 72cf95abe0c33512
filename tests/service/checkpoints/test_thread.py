"""Checkpoints are taken while samples arrive. A failing disk is reported and does no other harm."""

import errno
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dropanchor_schemas.wire import Frame, RangeSample
from dropanchor_service.checkpoints import thread as checkpointer
from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.checkpoints.thread import CheckpointThread
from dropanchor_service.estimation.columns import Array, State
from dropanchor_service.ingest.period import Period
from dropanchor_service.ingest.thread import IngestThread
from support.ingest import IngestBench, TransparentEngine
from support.zenoh_router import wait_until

T = 1_760_000_000_000_000_000


class RestorableEngine(TransparentEngine):
    """An engine whose state is the set of its rows."""

    def state(self) -> dict[str, Array]:
        return {"rows": np.array(list(self.configured), np.int32)}

    def restore(self, state: dict[str, Array]) -> None:
        self.configured = {row: [] for row in state["rows"].tolist()}

    def started_afresh(self) -> list[int]:
        """Return the rows that were configured, not restored."""
        return [row for row, settings in self.configured.items() if settings]


class CheckpointBench:
    """A bench that writes checkpoints to a folder."""

    def __init__(self, folder: Path, period_s: float = 0.01) -> None:
        self.engine = RestorableEngine()
        self.bench = IngestBench(engine=self.engine, folder=folder)
        self.bench.guarded_engine.follow_sites()
        state = self.bench.service_state()
        checkpoint_folder = CheckpointFolder(folder / "checkpoints", state.layout, state.as_present)
        self.checkpoints = CheckpointThread(state, checkpoint_folder, self.bench.metrics, period_s, self.bench.clock)
        self.thread = IngestThread(
            self.bench.ingest, self.bench.buffer, self.bench.metrics, Period(0.001), self.checkpoints.between_turns
        )

    def start(self) -> None:
        self.checkpoints.start()
        self.thread.start()

    def stop(self) -> None:
        self.thread.stop()
        self.checkpoints.stop()

    def count(self, outcome: str) -> float:
        """Return how many checkpoints had this outcome."""
        return self.bench.total(self.bench.metrics.checkpoints, outcome=outcome)

    def send(self, tag: str, value: float) -> None:
        self.bench.put(tag, Frame(ranges=[RangeSample(T, 7, value)]))


@pytest.fixture
def running(tmp_path: Path) -> Iterator[CheckpointBench]:
    bench = CheckpointBench(tmp_path)
    bench.start()
    yield bench
    bench.stop()


def test_poses_are_restored_after_a_restart_but_do_not_count_as_tracking(
    running: CheckpointBench, tmp_path: Path
) -> None:
    running.send("a", 4.0)
    running.send("b", 5.0)
    wait_until(lambda: running.bench.x_of("ab") == [4.0, 5.0])
    running.stop()
    after = CheckpointBench(tmp_path)
    after.checkpoints.load()
    assert after.bench.x_of("ab") == [4.0, 5.0]
    assert after.bench.latest.since()[1]["state"].tolist() == [State.COASTING, State.COASTING]
    assert [tag.name for tag in after.bench.tags.all()] == ["a", "b"]
    assert after.bench.tags.rows.at(1).samples == {"range": 1}
    assert after.engine.configured == {0: [], 1: []}


def test_a_service_on_a_host_whose_clock_was_set_back_goes_on_from_the_time_of_the_checkpoint(
    running: CheckpointBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    running.send("a", 4.0)
    wait_until(lambda: running.bench.x_of("a") == [4.0])
    running.stop()
    heard_ns = running.bench.tags.rows.at(0).last_heard_ns or 0
    monkeypatch.setattr(time, "time_ns", lambda: heard_ns - 9000 * 10**9)
    after = CheckpointBench(tmp_path)
    after.checkpoints.load()
    assert after.bench.x_of("a") == [4.0]
    assert 0 <= after.bench.clock.now_ns() - heard_ns < 10**9
    assert "the clock of this machine is 2 hours behind the one of its tags" in caplog.text


def test_rows_with_changed_settings_start_afresh_and_all_rows_do_after_an_anchor_has_moved(
    running: CheckpointBench, tmp_path: Path
) -> None:
    running.send("a", 4.0)
    running.send("b", 5.0)
    wait_until(lambda: running.bench.x_of("ab") == [4.0, 5.0])
    running.stop()
    changed = CheckpointBench(tmp_path)
    changed.bench.site.set_tag("b", changed.bench.site.tag_settings("b").model_copy(update={"height_m": 3.0}))
    changed.checkpoints.load()
    for tag in "ab":
        changed.bench.send(tag, Frame(ranges=[RangeSample(T + 1, 7, 6.0)]))
    assert changed.engine.started_afresh() == [1]
    moved = CheckpointBench(tmp_path)
    moved.bench.site.set_anchor(moved.bench.site.site.anchors[0].model_copy(update={"x": 1.0}))
    moved.checkpoints.load()
    for tag in "ab":
        moved.bench.send(tag, Frame(ranges=[RangeSample(T + 1, 7, 6.0)]))
    assert moved.engine.started_afresh() == [0, 1]


def look_again(running: CheckpointBench) -> None:
    """Wait until the thread has looked once more whether there is something to write."""
    looked = time.monotonic() - running.checkpoints.age_s
    wait_until(lambda: time.monotonic() - running.checkpoints.age_s > looked + 0.01)


def test_no_checkpoint_is_written_while_no_message_arrives(running: CheckpointBench) -> None:
    running.send("a", 4.0)
    wait_until(lambda: running.count("written") >= 1)
    look_again(running)  # the first may have come between the message and its turn
    written = running.count("written")
    look_again(running)
    assert running.count("written") == written


def test_the_first_checkpoint_does_not_wait_for_the_period(tmp_path: Path) -> None:
    bench = CheckpointBench(tmp_path, period_s=3600.0)
    bench.start()
    bench.send("a", 4.0)
    wait_until(lambda: bench.count("written") == 1)
    bench.stop()


def test_the_pause_is_long_while_much_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkpointer, "WEAR_BYTES_S", 0.1)
    bench = CheckpointBench(tmp_path)
    bench.start()
    bench.send("a", 4.0)
    wait_until(lambda: bench.count("written") == 1)
    bench.send("a", 6.0)
    wait_until(lambda: bench.bench.x_of("a") == [6.0])
    wait_until(lambda: bench.checkpoints.age_s > 0.5)
    assert bench.count("written") == 1
    assert bench.checkpoints.problem is None
    bench.stop()
    assert bench.count("written") == 2


def test_a_full_disk_is_reported_and_counted_until_there_is_space_again(
    running: CheckpointBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpointer, "OLD_S", 0.3)

    def full(*_: Any) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as disk:
        disk.setattr(os, "write", full)
        running.send("a", 4.0)
        wait_until(lambda: "No space left on device" in (running.checkpoints.problem or ""))
        wait_until(lambda: running.count("failed") >= 1)
        wait_until(lambda: running.bench.x_of("a") == [4.0])
        assert running.thread.problem is None
        written = running.count("written")
    wait_until(lambda: running.checkpoints.problem is None and running.count("written") > written)


def test_a_state_that_cannot_be_copied_stops_neither_the_ingest_nor_later_checkpoints(
    running: CheckpointBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpointer, "OLD_S", 0.3)
    monkeypatch.setattr(checkpointer, "_TURN_S", 0.05)

    def broken() -> dict[str, Array]:
        raise RuntimeError("a bug")

    with monkeypatch.context() as fault:
        fault.setattr(running.engine, "state", broken)
        running.send("a", 4.0)
        wait_until(lambda: running.checkpoints.problem)
        running.send("a", 6.0)
        wait_until(lambda: running.bench.x_of("a") == [6.0])
    wait_until(lambda: running.checkpoints.problem is None)

"""Checkpoints are taken while samples come in, and a disk that fails is told, and does no harm beyond."""

import errno
import os
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
from dropanchor_service.ingest.thread import IngestThread
from support.ingest import IngestBench, TransparentEngine
from support.zenoh_router import wait_until

T = 1_760_000_000_000_000_000


class KeepingEngine(TransparentEngine):
    """Its state is which rows it has."""

    def state(self) -> dict[str, Array]:
        return {"rows": np.array(list(self.configured), np.int32)}

    def restore(self, state: dict[str, Array]) -> None:
        self.configured = {row: [] for row in state["rows"].tolist()}

    def started_afresh(self) -> list[int]:
        """Rows that were configured, not restored."""
        return [row for row, settings in self.configured.items() if settings]


class Kept:
    """A bench whose state is kept in a folder."""

    def __init__(self, folder: Path) -> None:
        self.engine = KeepingEngine()
        self.bench = IngestBench(engine=self.engine, folder=folder)
        self.bench.guarded_engine.follow_site()
        state = self.bench.service_state()
        kept = CheckpointFolder(folder / "checkpoints", state.layout, state.template)
        self.checkpoints = CheckpointThread(state, kept, self.bench.metrics, period_s=0.01)
        self.thread = IngestThread(
            self.bench.ingest, self.bench.buffer, self.bench.metrics, 0.001, self.checkpoints.between_turns
        )

    def start(self) -> None:
        self.checkpoints.start()
        self.thread.start()

    def stop(self) -> None:
        self.thread.stop()
        self.checkpoints.stop()

    def count(self, outcome: str) -> float:
        return float(self.bench.metrics.checkpoints.labels(outcome)._value.get())

    def hear(self, tag: str, value: float) -> None:
        self.bench.put(tag, Frame(ranges=[RangeSample(T, 7, value)]))


@pytest.fixture
def kept(tmp_path: Path) -> Iterator[Kept]:
    running = Kept(tmp_path)
    running.start()
    yield running
    running.stop()


def test_what_was_heard_is_there_after_a_restart_and_does_not_count_as_tracking(kept: Kept, tmp_path: Path) -> None:
    kept.hear("a", 4.0)
    kept.hear("b", 5.0)
    wait_until(lambda: kept.bench.x_of("ab") == [4.0, 5.0])
    kept.stop()
    after = Kept(tmp_path)
    after.checkpoints.load()
    assert after.bench.x_of("ab") == [4.0, 5.0]
    assert after.bench.latest.since()[1]["state"].tolist() == [State.COASTING, State.COASTING]
    assert [tag.name for tag in after.bench.tags.all()] == ["a", "b"]
    assert after.bench.tags.at(1).samples == {"range": 1}
    assert after.engine.configured == {0: [], 1: []}


def test_rows_whose_settings_have_changed_since_start_afresh_and_all_when_an_anchor_has_moved(
    kept: Kept, tmp_path: Path
) -> None:
    kept.hear("a", 4.0)
    kept.hear("b", 5.0)
    wait_until(lambda: kept.bench.x_of("ab") == [4.0, 5.0])
    kept.stop()
    changed = Kept(tmp_path)
    changed.bench.site.set_tag("b", changed.bench.site.tag_settings("b").model_copy(update={"height_m": 3.0}))
    changed.checkpoints.load()
    for tag in "ab":
        changed.bench.send(tag, Frame(ranges=[RangeSample(T + 1, 7, 6.0)]))
    assert changed.engine.started_afresh() == [1]
    moved = Kept(tmp_path)
    moved.bench.site.set_anchor(moved.bench.site.site.anchors[0].model_copy(update={"x": 1.0}))
    moved.checkpoints.load()
    for tag in "ab":
        moved.bench.send(tag, Frame(ranges=[RangeSample(T + 1, 7, 6.0)]))
    assert moved.engine.started_afresh() == [0, 1]


def test_nothing_is_written_while_nothing_comes_in(kept: Kept) -> None:
    kept.hear("a", 4.0)
    wait_until(lambda: kept.count("written") >= 1)
    wait_until(lambda: kept.checkpoints.age_s < 0.05)
    written = kept.count("written")
    before = kept.checkpoints.age_s
    wait_until(lambda: kept.checkpoints.age_s < before)  # it looked again
    assert kept.count("written") == written


def test_a_full_disk_is_told_and_counted_and_forgotten_when_there_is_room_again(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpointer, "OLD_S", 0.3)

    def full(*_: Any) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as disk:
        disk.setattr(os, "write", full)
        kept.hear("a", 4.0)
        wait_until(lambda: "No space left on device" in (kept.checkpoints.problem or ""))
        assert kept.bench.x_of("a") == [4.0]
        assert kept.count("failed") >= 1
        assert kept.thread.problem is None
    wait_until(lambda: kept.checkpoints.problem is None)
    assert kept.count("written") >= 1


def test_a_state_that_cannot_be_copied_stops_neither_ingest_nor_the_checkpoints(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpointer, "OLD_S", 0.3)
    monkeypatch.setattr(checkpointer, "_TURN_S", 0.05)

    def broken() -> dict[str, Array]:
        raise RuntimeError("a bug")

    with monkeypatch.context() as fault:
        fault.setattr(kept.engine, "state", broken)
        kept.hear("a", 4.0)
        wait_until(lambda: kept.checkpoints.problem)
        kept.hear("a", 6.0)
        wait_until(lambda: kept.bench.x_of("a") == [6.0])
    wait_until(lambda: kept.checkpoints.problem is None)

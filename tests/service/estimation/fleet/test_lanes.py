"""Threads share the rows of a batch: the same bits with any number of them, and a fault is raised when all are done."""

from functools import partial
from threading import Barrier, Event

import numpy as np
import pytest

from dropanchor_service.estimation.columns import ANCHOR, Array, PoseBatch, SampleBatch
from dropanchor_service.estimation.fleet import lanes
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.lanes import Lanes
from support.fleet_runs import cut, samples, settings
from support.fleet_tracks import CALIBRATED

ROWS = 12
S = 1_000_000_000


@pytest.fixture(scope="module")
def many() -> SampleBatch:
    """Return samples of rows that differ, half of which have an unknown start."""
    runs = [cut(samples(2020 + row, row)[0], 0, 8 * S) for row in range(ROWS)]
    return SampleBatch(
        imu=np.concatenate([run.imu for run in runs]),
        ranges=np.concatenate([run.ranges for run in runs]),
        headings=np.concatenate([run.headings for run in runs]),
    )


def fleet_of(threads: int) -> FleetEngine:
    fleet = FleetEngine(CALIBRATED, threads=threads)
    fleet.set_anchors(np.zeros(1, ANCHOR))
    for row in range(ROWS):
        fleet.configure(row, settings(known=row % 2 == 0))
    return fleet


def bits(batch: PoseBatch) -> list[bytes]:
    return [column.tobytes() for column in (batch.poses, batch.hypotheses, batch.innovations, batch.lags)]


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lanes, "PART_SAMPLES", 8)


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("threads", [2, 3, 4])
def test_the_bits_are_the_same_with_any_number_of_threads(many: SampleBatch, threads: int) -> None:
    alone, shared = fleet_of(1), fleet_of(threads)
    for begin in range(0, 8 * S, S // 2):
        piece = cut(many, begin, begin + S // 2)
        found, expected = shared.process(piece), alone.process(piece)
        assert bits(found) == bits(expected)
        assert len(expected.poses) == ROWS * 5


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize(("before", "after"), [(1, 3), (3, 1), (4, 2)])
def test_a_checkpoint_goes_on_with_another_number_of_threads(many: SampleBatch, before: int, after: int) -> None:
    fleet, restored = fleet_of(before), FleetEngine(CALIBRATED, threads=after)
    fleet.process(cut(many, 0, 2 * S))
    restored.set_anchors(np.zeros(1, ANCHOR))
    restored.restore({name: array.copy() for name, array in fleet.state().items()})
    for begin in range(2 * S, 8 * S, S):
        piece = cut(many, begin, begin + S)
        assert bits(restored.process(piece)) == bits(fleet.process(piece))


def test_a_batch_is_cut_between_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lanes, "PART_SAMPLES", 1)
    imu_rows = np.array([5, 5, 5, 2, 2, 9, 9, 9, 9, 9, 9, 9, 9])
    event_rows = np.array([5, 2, 7])
    order = np.array([0, 1, 13, 2, 3, 14, 4, 5, 6, 7, 8, 9, 10, 11, 12, 15])
    rows = np.concatenate([imu_rows, event_rows])[order]
    parts = Lanes(4).cut(order, imu_rows, event_rows)
    assert [place for part in parts for place in range(part.start, part.stop)] == list(range(len(order)))
    assert [sorted(set(rows[part].tolist())) for part in parts] == [[5], [2], [9], [7]]
    assert Lanes(1).cut(order, imu_rows, event_rows) == [slice(0, len(order))]
    assert Lanes(4).cut(order[:0], imu_rows, event_rows) == [slice(0, 0)]


def test_jobs_run_at_the_same_time_and_return_in_their_order() -> None:
    meet = Barrier(3, timeout=60.0)

    def job(number: int, lane: int) -> tuple[int, int]:
        meet.wait()
        return number, lane

    results = Lanes(3).run([partial(job, number) for number in range(3)])
    assert [number for number, _ in results] == [0, 1, 2]
    assert sorted(lane for _, lane in results) == [0, 1, 2]


def test_an_error_is_raised_when_all_lanes_have_ended() -> None:
    ended = Event()

    def fail(_: int) -> Array:
        raise ValueError("a job failed")

    def last(_: int) -> Array:
        ended.wait(0.2)
        ended.set()
        return np.zeros(0)

    with pytest.raises(ValueError, match="a job failed"):
        Lanes(2).run([fail, last])
    assert ended.is_set()

"""Which poses are kept."""

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.store.thinning import Decimation

SECOND = 1_000_000_000
T_NS = 1_800_000_000 * SECOND


def track(seconds: Array, x: Array, row: int = 0) -> Array:
    poses = np.zeros(len(seconds), POSE)
    poses["row"], poses["x"], poses["state"] = row, x, State.TRACKING
    poses["t_ns"] = T_NS + np.rint(np.asarray(seconds) * SECOND).astype(np.int64)
    return poses


def seconds_of(poses: Array) -> list[float]:
    return [round((t_ns - T_NS) / SECOND, 3) for t_ns in poses["t_ns"].tolist()]


def test_a_tag_that_moves_is_kept_once_a_second_whatever_comes_together() -> None:
    times = np.arange(0, 10, 0.1)
    poses = track(times, 2 * times)
    at_once = Decimation(SECOND, 0.1, 5 * SECOND).of(poses)
    assert seconds_of(at_once) == list(range(10))
    one_by_one = Decimation(SECOND, 0.1, 5 * SECOND)
    np.testing.assert_array_equal(np.concatenate([one_by_one.of(poses[i : i + 1]) for i in range(100)]), at_once)


def test_a_tag_that_stands_is_kept_seldom_and_at_once_when_its_state_changes() -> None:
    times = np.arange(0, 12, 0.1)
    poses = track(times, np.zeros(120))
    assert seconds_of(Decimation(SECOND, 0.1, 5 * SECOND).of(poses)) == [0, 5, 10]
    poses["state"][71:] = State.COASTING
    assert seconds_of(Decimation(SECOND, 0.1, 5 * SECOND).of(poses)) == [0, 5, 8]


def test_rows_do_not_mix_and_a_clock_that_was_set_back_begins_anew() -> None:
    thinning = Decimation(SECOND, 0.1, 5 * SECOND)
    both = np.concatenate([track(np.arange(3.0), np.arange(3.0), row) for row in (3, 1)])
    assert sorted(thinning.of(both)["row"].tolist()) == [1, 1, 1, 3, 3, 3]
    assert len(thinning.of(track(np.array([-3600.0]), np.array([2.0]), 3))) == 1


def test_of_a_tag_whose_place_is_unknown_a_pose_is_kept_now_and_then() -> None:
    times = np.arange(0, 10, 0.5)
    assert seconds_of(Decimation(SECOND, 0.1, 5 * SECOND).of(track(times, np.full(20, np.nan)))) == [0, 5]

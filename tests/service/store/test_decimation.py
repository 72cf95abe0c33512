"""Decimation keeps one pose per period, and fewer of a tag that stands still."""

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, Frame, State
from dropanchor_service.store.decimation import Decimation

SECOND = 1_000_000_000
T_NS = 1_800_000_000 * SECOND


def track(seconds: Array, x: Array, row: int = 0) -> Array:
    poses = np.zeros(len(seconds), POSE)
    poses["row"], poses["x"], poses["state"] = row, x, State.TRACKING
    poses["t_ns"] = T_NS + np.rint(np.asarray(seconds) * SECOND).astype(np.int64)
    return poses


def seconds_of(poses: Array) -> list[float]:
    return [round((t_ns - T_NS) / SECOND, 3) for t_ns in poses["t_ns"].tolist()]


def test_one_pose_per_second_is_kept_of_a_moving_tag_however_poses_are_batched() -> None:
    times = np.arange(0, 10, 0.1)
    poses = track(times, 2 * times)
    at_once = Decimation(SECOND, 0.1, 5 * SECOND).select(poses)
    assert seconds_of(at_once) == list(range(10))
    one_by_one = Decimation(SECOND, 0.1, 5 * SECOND)
    np.testing.assert_array_equal(np.concatenate([one_by_one.select(poses[i : i + 1]) for i in range(100)]), at_once)


def test_few_poses_are_kept_of_a_tag_that_stands_still_until_its_state_changes() -> None:
    times = np.arange(0, 12, 0.1)
    poses = track(times, np.zeros(120))
    assert seconds_of(Decimation(SECOND, 0.1, 5 * SECOND).select(poses)) == [0, 5, 10]
    poses["state"][71:] = State.COASTING
    assert seconds_of(Decimation(SECOND, 0.1, 5 * SECOND).select(poses)) == [0, 5, 8]


def test_the_first_pose_in_another_frame_is_kept_though_its_numbers_are_alike() -> None:
    poses = track(np.arange(0, 12, 0.1), np.zeros(120))
    poses["frame"][71:] = Frame.SITE
    poses["frame"][:71] = Frame.RELATIVE
    assert seconds_of(Decimation(SECOND, 0.1, 5 * SECOND).select(poses)) == [0, 5, 8]


def test_rows_do_not_mix_and_decimation_restarts_after_a_clock_was_set_back() -> None:
    decimation = Decimation(SECOND, 0.1, 5 * SECOND)
    both = np.concatenate([track(np.arange(3.0), np.arange(3.0), row) for row in (3, 1)])
    assert sorted(decimation.select(both)["row"].tolist()) == [1, 1, 1, 3, 3, 3]
    assert len(decimation.select(track(np.array([-3600.0]), np.array([2.0]), 3))) == 1


def test_few_poses_are_kept_of_a_tag_whose_position_is_unknown() -> None:
    times = np.arange(0, 10, 0.5)
    assert seconds_of(Decimation(SECOND, 0.1, 5 * SECOND).select(track(times, np.full(20, np.nan)))) == [0, 5]


def test_a_tag_in_a_lift_is_kept_though_it_stands_on_the_map() -> None:
    poses = track(np.arange(0, 4), np.zeros(4))
    poses["z"] = [0.0, 0.2, 0.6, np.nan]
    assert seconds_of(Decimation(SECOND, 0.1, 5 * SECOND).select(poses)) == [0, 2]

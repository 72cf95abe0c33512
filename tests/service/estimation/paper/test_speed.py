"""Speed from ranges alone."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_service.estimation.paper.speed import KeyRange, SpeedEstimator, speed_squared


def on_line(t: float, v: float, along: float, across: float, height: float = 0.0) -> KeyRange:
    return KeyRange(t, math.sqrt((along + v * t) ** 2 + across**2 + height**2))


def printed_in_the_paper(k0: KeyRange, k1: KeyRange, k2: KeyRange) -> float:
    dt1, dt2 = k1.t - k0.t, k2.t - k1.t
    rise = (k2.r**2 - k1.r**2) - dt2 / dt1 * (k1.r**2 - k0.r**2)
    return rise / (dt1 * dt2 + dt1**2)


@given(
    v=st.floats(0.1, 10),
    along=st.floats(-50, 50),
    across=st.floats(0, 30),
    height=st.floats(0, 3),
    dt1=st.floats(0.1, 5),
    dt2=st.floats(0.1, 5),
)
def test_three_ranges_at_any_times_give_the_speed_on_a_straight_line(
    v: float, along: float, across: float, height: float, dt1: float, dt2: float
) -> None:
    points = [on_line(t, v, along, across, height) for t in (0.0, dt1, dt1 + dt2)]
    assert speed_squared(*points) == pytest.approx(v * v, rel=1e-6, abs=1e-8)


def test_the_denominator_printed_in_the_paper_is_wrong_where_intervals_differ() -> None:
    points = [on_line(t, v=2.0, along=-3.0, across=4.0) for t in (0.0, 0.4, 1.5)]
    assert math.sqrt(speed_squared(*points)) == pytest.approx(2.0)
    assert math.sqrt(printed_in_the_paper(*points)) == pytest.approx(3.317, abs=1e-3)


def test_the_denominator_printed_in_the_paper_is_right_for_equal_intervals() -> None:
    points = [on_line(t, v=2.0, along=-3.0, across=4.0) for t in (0.0, 0.5, 1.0)]
    assert printed_in_the_paper(*points) == pytest.approx(speed_squared(*points))


def test_a_range_makes_a_key_pair_only_when_it_has_moved_by_the_threshold() -> None:
    estimator = SpeedEstimator(threshold=1.0, spacing=1, window_base=1, window_ratio=0)
    speeds = [estimator.step(t, 10 + t) for t in np.arange(0, 5, 0.25).tolist()]  # radially away at 1 m/s
    given_at = [0.25 * i for i, v in enumerate(speeds) if v is not None]
    assert given_at == [2.5, 3.75]  # pairs at 0, 1.25, 2.5, 3.75
    assert all(v == pytest.approx(1.0) for v in speeds if v is not None)


def test_approaching_ranges_make_key_pairs_too() -> None:
    estimator = SpeedEstimator(threshold=1.0, spacing=1, window_base=1, window_ratio=0)
    speeds = [estimator.step(t, on_line(t, v=1.5, along=-20, across=5).r) for t in np.arange(0, 9, 0.1).tolist()]
    assert [v for v in speeds if v is not None] == pytest.approx([1.5] * sum(v is not None for v in speeds))
    assert any(v is not None for v in speeds)


def test_points_may_be_several_key_pairs_apart() -> None:
    estimator = SpeedEstimator(threshold=0.1, spacing=3, window_base=1, window_ratio=0)
    speeds = [estimator.step(t, on_line(t, v=2.0, along=5, across=5).r) for t in np.arange(0, 1.75, 0.25).tolist()]
    assert speeds[:6] == [None] * 6
    assert speeds[6] == pytest.approx(2.0)


@pytest.mark.parametrize(("ratio", "expected"), [(0.0, 7.0), (0.1, 5.0), (100.0, 4.0)])
def test_the_window_of_the_mean_grows_with_the_range(ratio: float, expected: float) -> None:
    """Move radially outward near 40 m at 1, 2, … 7 m/s, with three key pairs for each speed."""
    estimator = SpeedEstimator(threshold=0.01, spacing=1, window_base=1, window_ratio=ratio)
    mean = None
    for v in range(1, 8):
        estimator.end_of_line()
        for i in range(3):
            mean = estimator.step(100.0 * v + 0.1 * i, 40 + 0.1 * v * i)
    assert mean == pytest.approx(expected)  # the last 1, 5 and all 7 speeds


def test_ranges_that_noise_has_bent_the_wrong_way_give_no_speed() -> None:
    estimator = SpeedEstimator(threshold=0.1, spacing=1, window_base=1, window_ratio=0)
    assert [estimator.step(t, r) for t, r in ((0.0, 10.0), (1.0, 12.0), (2.0, 12.2))] == [None, None, None]


def test_pairs_from_before_a_turn_are_forgotten() -> None:
    estimator = SpeedEstimator(threshold=0.1, spacing=1, window_base=1, window_ratio=0)
    for t in (0.0, 1.0):
        estimator.step(t, on_line(t, v=1.0, along=5, across=5).r)
    estimator.end_of_line()
    assert estimator.step(2.0, on_line(2.0, v=1.0, along=5, across=5).r) is None


def test_a_second_range_of_the_same_instant_does_not_divide_by_zero() -> None:
    estimator = SpeedEstimator(threshold=0.1, spacing=1, window_base=1, window_ratio=0)
    assert [estimator.step(0.0, r) for r in (1.0, 2.0, 3.0, 4.0)] == [None] * 4

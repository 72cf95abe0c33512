"""The states of the engine `paper` and their reasons."""

import numpy as np
import pytest

from dropanchor_service.estimation.columns import (
    SampleBatch,
    State,
    StateReason,
    default_settings,
)
from service.estimation.paper.one_row import engine, headings, imu, ranges, start, state_of


def test_without_a_heading_the_tag_is_initialising() -> None:
    poses = engine().process(ranges((0, 10.0))).poses
    assert state_of(poses) == (State.INITIALISING, StateReason.NO_HEADING)
    assert np.isnan(poses["x"]).all()


@pytest.mark.parametrize("source", [headings((0, 1.0)), imu(0, mag=(0, 20, -44))], ids=["platform", "9-axis"])
def test_without_a_start_the_tag_is_ambiguous_and_its_place_not_a_number(source: SampleBatch) -> None:
    made = engine(default_settings())
    made.process(source)
    poses = made.process(ranges((0.1, 10.0), (0.2, 10.1))).poses
    assert state_of(poses) == (State.AMBIGUOUS, StateReason.START_UNKNOWN)
    assert np.isnan(poses["x"]).all()
    assert np.isnan(poses["y"]).all()
    assert np.isfinite(poses["heading"]).all()


def test_a_6_axis_tag_needs_the_heading_of_its_start() -> None:
    without, with_it = engine(), engine(start(start_heading=2.0))
    for made, expected in ((without, State.AMBIGUOUS), (with_it, State.TRACKING)):
        made.process(imu(0, 0.01))
        poses = made.process(ranges((0.02, 10.0))).poses
        assert state_of(poses)[0] == expected
    assert poses["heading"][-1] == pytest.approx(2.0, abs=1e-6)


def test_a_range_that_fits_is_fused_and_one_that_does_not_is_refused() -> None:
    made = engine()
    made.process(headings((0, 0.0)))
    poses = made.process(ranges((0, 10.0), (0.1, 35.0))).poses
    assert poses["range"].tolist() == [10.0, 10.0]
    assert state_of(poses)[0] == State.TRACKING  # one bad range is no drama
    assert poses["x"][-1] == pytest.approx(poses["x"][0], abs=0.1)


def test_every_range_that_met_a_belief_comes_with_its_innovation() -> None:
    made = engine()
    made.process(headings((0, 0.0)))
    innovations = made.process(ranges((0.1, 10.0), (0.2, 10.1), (0.3, 30.0))).innovations
    np.testing.assert_allclose(innovations["measured"] - innovations["predicted"], innovations["innovation"])
    assert innovations["measured"].tolist() == [10.0, 10.1, 30.0]
    assert innovations["fused"].tolist() == [True, True, False]
    assert innovations["innovation"][-1] ** 2 / innovations["S"][-1] > 25
    assert np.isnan(innovations["p_outlier"]).all()


def test_refused_ranges_make_it_coast_and_then_lose_the_tag() -> None:
    made = engine()
    made.process(headings((0, 0.0)))
    made.process(ranges((0, 10.0)))
    seen = []
    for i in range(1, 400):
        made.process(headings((i * 0.1, 0.0)))
        seen.append(state_of(made.process(ranges((i * 0.1, 500.0 + 3 * i))).poses))
    assert seen[0][0] == State.TRACKING
    assert seen[15] == (State.COASTING, StateReason.RANGES_REJECTED)
    assert seen[-1] == (State.LOST, StateReason.RANGES_REJECTED)
    # a filter with one mode cannot find itself again: only a new start ends LOST
    made.process(headings((40.0, 0.0)))
    assert state_of(made.process(ranges((40.0, 10.0))).poses)[0] == State.LOST
    made.configure(0, start())
    made.process(headings((40.1, 0.0)))
    assert state_of(made.process(ranges((40.1, 10.0))).poses)[0] == State.TRACKING


def test_a_long_silence_of_ranges_loses_the_tag() -> None:
    made = engine()
    made.process(headings((0, 0.0)))
    made.process(ranges((0, 10.0)))
    made.process(headings(*((t, 0.0) for t in np.arange(0.1, 60, 0.1).tolist())))
    assert state_of(made.process(ranges((60.0, 10.0))).poses) == (State.LOST, StateReason.RANGES_MISSING)


def test_a_tag_whose_heading_stopped_is_degraded() -> None:
    made = engine()
    made.process(headings((0, 0.0)))
    made.process(ranges((0, 10.0)))
    poses = made.process(ranges(*((t, 10.0) for t in (0.5, 1.0, 1.5)))).poses
    assert state_of(poses) == (State.DEGRADED, StateReason.IMU_MISSING)


def test_a_tag_whose_ellipse_has_grown_too_large_is_degraded() -> None:
    made = engine(start(start_std=4.0))
    made.process(headings((0, 0.0)))
    poses = made.process(ranges((0, 10.0))).poses
    assert state_of(poses) == (State.DEGRADED, StateReason.UNCERTAIN)
    assert poses["sigma_pos"][0] > 1.5


@pytest.mark.parametrize(
    ("reverse_allowed", "expected"),
    [(False, (State.DEGRADED, StateReason.SEVERAL_MODES)), (True, (State.TRACKING, StateReason.RESOLVED))],
)
def test_a_tag_believed_to_drive_backwards_is_degraded_unless_it_may(
    reverse_allowed: bool, expected: tuple[State, StateReason]
) -> None:
    made = engine(start(reverse_allowed=reverse_allowed))
    for i in range(50):  # looks away from the anchor and comes nearer
        made.process(headings((i * 0.1, 0.0)))
        poses = made.process(ranges((i * 0.1, 10 - 0.1 * i))).poses
    assert poses["speed"][0] < -0.5
    assert state_of(poses) == expected

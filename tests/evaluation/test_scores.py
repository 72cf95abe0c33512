"""Scores of runs, against numbers worked out by hand."""

import numpy as np
import pytest

from dropanchor_evaluation.paper import unknown_start
from dropanchor_evaluation.paper.scores import RunScore, bound_of, score, summary
from dropanchor_evaluation.pcrb import Sensors
from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.offline.replay import Track
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate


@pytest.fixture(scope="module")
def line() -> Simulation:
    return simulate("L1", 5, preset("real"))


def beside(simulation: Simulation, offset: Array, std: float) -> Track:
    """A track that is off by offset (n, 2), or one for all (2,), at every tenth instant of the truth."""
    truth = simulation.truth
    poses = np.zeros(len(truth.t_s[::10]), POSE)
    poses["x"], poses["y"] = truth.x[::10] + offset[..., 0], truth.y[::10] + offset[..., 1]
    poses["cov"][:, 0, 0] = poses["cov"][:, 1, 1] = std**2
    poses["state"] = State.TRACKING
    return Track(truth.t_s[::10], poses)


def test_a_constant_error_has_its_mean_square_and_its_nees(line: Simulation) -> None:
    found = score(line, beside(line, np.array([0.3, -0.4]), std=0.25), np.full(len(line.truth.t_s), 0.04))
    assert found.mse == pytest.approx(0.25)
    assert found.nees == pytest.approx(0.25 / 0.0625)
    assert found.coverage == 1.0  # 4 < 5.99
    assert found.bound == pytest.approx(0.04)
    assert found.missing == 0.0


def test_errors_that_follow_their_covariance_have_nees_2_and_95_percent_inside(line: Simulation) -> None:
    n = len(line.truth.t_s[::10])
    offsets = np.random.default_rng(1).normal(0.0, 0.5, (n, 2))
    found = score(line, beside(line, offsets, std=0.5), np.ones(len(line.truth.t_s)))
    assert found.nees / 2 == pytest.approx(1.0, abs=0.2)
    assert found.coverage == pytest.approx(0.95, abs=0.04)


def test_poses_without_a_position_are_missing_and_never_having_one_is_an_infinite_error(line: Simulation) -> None:
    track = beside(line, np.array([1.0, 0.0]), std=1.0)
    track.poses["x"][: len(track.poses) // 4] = np.nan
    bound = np.ones(len(line.truth.t_s))
    assert score(line, track, bound).missing == pytest.approx(0.25, abs=0.01)
    track.poses["x"] = np.nan
    assert score(line, track, bound).mse == np.inf


def test_a_summary_is_of_rmse_over_runs_and_its_ratio_of_mean_squares() -> None:
    runs = [RunScore(mse=m, bound=0.25, nees=2.0, coverage=0.9, missing=0.0) for m in (0.25, 1.0, 9.0)]
    row = summary(runs)
    assert (row.median, row.worst) == (1.0, 3.0)
    assert row.p90 == pytest.approx(2.6)
    assert row.above_2m == pytest.approx(1 / 3)
    assert row.ratio == pytest.approx(np.sqrt((0.25 + 1.0 + 9.0) / 3 / 0.25))
    assert row.median_ratio == pytest.approx(2.0)
    assert row.nees_half == pytest.approx(1.0)


def test_a_bound_for_jumps_is_not_given_where_the_speed_changes_all_the_time(line: Simulation) -> None:
    wandering = simulate("OU", 0, preset("real"))
    jumps, accelerometer = "range+heading, jumps known", "with accelerometer"
    assert np.isnan(bound_of(wandering, Sensors(), jumps)).all()  # type: ignore[arg-type]
    assert np.isfinite(bound_of(wandering, Sensors(), accelerometer)).all()  # type: ignore[arg-type]
    assert np.isfinite(bound_of(line, Sensors(), jumps)).all()  # type: ignore[arg-type]
    assert np.isnan(bound_of(line, Sensors(), None)).all()


def test_a_declaration_is_timed_and_judged_where_it_was_made(line: Simulation) -> None:
    offset = np.zeros((len(line.truth.t_s[::10]), 2))
    offset[:, 0] = np.where(line.truth.t_s[::10] < 20.0, 50.0, 0.1)
    track = beside(line, offset, std=0.2)
    track.poses["state"][line.truth.t_s[::10] < 10.0] = State.AMBIGUOUS
    early = unknown_start.score(line, track)
    assert early.declared_s == pytest.approx(10.0, abs=0.11)
    assert (early.first_wrong, early.right_at_end) == (1.0, 1.0)
    track.poses["state"][line.truth.t_s[::10] < 25.0] = State.AMBIGUOUS
    late = unknown_start.score(line, track)
    assert late.first_wrong == 0.0
    assert late.rmse == pytest.approx(0.1)
    assert late.coverage == 1.0
    assert late.coverage_all == pytest.approx(0.5, abs=0.02)
    assert late.resolved_s == pytest.approx(20.0, abs=0.11)


def test_a_run_without_a_declaration_is_neither_wrong_nor_late(line: Simulation) -> None:
    track = beside(line, np.array([30.0, 30.0]), std=1.0)
    track.poses["state"] = State.AMBIGUOUS
    row = unknown_start.summary([unknown_start.score(line, track)])
    assert row.never == 1.0
    assert np.isnan([row.declared_median, row.first_wrong, row.coverage]).all()
    assert row.right_at_end == 0.0
    assert (row.above_2m, row.resolved_median) == (1.0, np.inf)


def test_a_place_that_was_always_right_is_resolved_from_the_first_pose_on(line: Simulation) -> None:
    track = beside(line, np.array([0.2, 0.2]), std=1.0)
    one = unknown_start.score(line, track)
    assert one.resolved_s == 0.0
    assert one.nees == pytest.approx(0.08)

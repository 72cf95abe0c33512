"""Accuracy against truth."""

import numpy as np
import pytest

from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.offline.accuracy import Truth, accuracy, truth_at

T = np.linspace(0.0, 10.0, 101)
TRUTH = Truth(T, 5.0 + np.cos(T), 2.0 + np.sin(T))


def poses(x: Array, y: Array, std: float = 1.0) -> Array:
    rows = np.zeros(len(x), POSE)
    rows["x"], rows["y"], rows["state"] = x, y, State.TRACKING
    rows["cov"] = np.diag([std**2, std**2, 1.0])
    return rows


def test_an_offset_is_the_error_and_the_rigid_motion_removes_it() -> None:
    result = accuracy(T, poses(TRUTH.x + 3.0, TRUTH.y - 4.0), TRUTH, (0.0, 0.0))
    assert (result.rmse, result.mean, result.worst) == pytest.approx((5.0, 5.0, 5.0))
    assert result.ate == pytest.approx(0.0, abs=1e-9)
    assert result.rmse_rotated > 1.0


def test_a_rotation_about_the_anchor_is_distinguished_from_other_errors() -> None:
    anchor = np.array([1.0, 1.0])
    c, s = np.cos(0.3), np.sin(0.3)
    turned = (np.column_stack([TRUTH.x, TRUTH.y]) - anchor) @ np.array([[c, s], [-s, c]]) + anchor
    result = accuracy(T, poses(*turned.T), TRUTH, (1.0, 1.0))
    assert result.rmse > 0.5
    assert result.rmse_rotated == pytest.approx(0.0, abs=1e-9)


def test_coverage_is_the_share_of_truths_inside_their_ellipse() -> None:
    rng = np.random.default_rng(5)
    t = np.linspace(0.0, 10.0, 20_000)
    truth_x, truth_y = truth_at(TRUTH, t)
    noisy = poses(truth_x + rng.normal(0, 0.5, len(t)), truth_y + rng.normal(0, 0.5, len(t)), std=0.5)
    assert accuracy(t, noisy, TRUTH, (0.0, 0.0)).coverage == pytest.approx(0.95, abs=0.01)
    noisy["cov"] *= 0.01
    assert accuracy(t, noisy, TRUTH, (0.0, 0.0)).coverage < 0.1


def test_unknown_positions_and_gaps_in_the_truth_are_left_out() -> None:
    gap = Truth(np.array([0.0, 1.0, 9.0, 10.0]), np.zeros(4), np.zeros(4))
    track = poses(np.zeros(101), np.zeros(101))
    track["x"][:5] = np.nan
    assert accuracy(T, track, gap, (0.0, 0.0)).compared == int(((T <= 1.0) | (T >= 9.0)).sum()) - 5


def test_a_track_without_any_position_has_no_accuracy() -> None:
    track = poses(np.full(101, np.nan), np.full(101, np.nan))
    with pytest.raises(ValueError, match="no pose has a position"):
        accuracy(T, track, TRUTH, (0.0, 0.0))


def test_the_shares_of_time_are_by_state() -> None:
    track = poses(TRUTH.x, TRUTH.y)
    track["state"][:50] = State.AMBIGUOUS
    shares = accuracy(T, track, TRUTH, (0.0, 0.0)).share_of_time
    assert shares == pytest.approx({"ambiguous": 0.5, "tracking": 0.5})

"""Scores of constructed tracks."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from dropanchor_evaluation.product.scores import TagScore, rotated_onto, score, summary
from dropanchor_service.estimation.columns import POSE, State
from dropanchor_service.offline.accuracy import Truth
from dropanchor_service.offline.replay import Track

Array = NDArray[np.float64]
N = 101
T = np.arange(N) / 10
ARC = np.column_stack([10 * np.cos(T / 5), 10 * np.sin(T / 5)])
ANCHOR = (3.0, -2.0)


def track(found: Array, std: float = 1.0, state: State = State.TRACKING) -> Track:
    poses = np.zeros(N, POSE)
    poses["x"], poses["y"], poses["state"] = found[:, 0], found[:, 1], state
    poses["cov"] = np.eye(3) * std**2
    return Track(T, poses)


def scored(one: Track, no_north: bool = False) -> TagScore:
    return score("tag", one, Truth(T, ARC[:, 0], ARC[:, 1]), ANCHOR, no_north)


def shifted(points: Array, x: float, y: float = 0.0) -> Array:
    return np.asarray(points + np.array([x, y]))


def turned(points: Array, angle: float) -> Array:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.asarray((points - ANCHOR) @ np.array([[cos, sin], [-sin, cos]]) + ANCHOR)


def test_a_constant_error_is_the_rmse_the_end_and_the_sigmas() -> None:
    one = scored(track(shifted(ARC, 0.3, 0.4), std=0.25))
    assert (one.rmse, one.second_half, one.end) == pytest.approx((0.5, 0.5, 0.5))
    assert one.worst_sigma == pytest.approx(2.0)
    assert (one.tracked, one.covered) == (N, N)


def test_the_95_percent_ellipse_ends_at_2_45_sigma() -> None:
    offset = np.zeros((N, 2))
    offset[:40, 0], offset[40:, 0] = 2.44, 2.46
    one = scored(track(ARC + offset))
    assert (one.tracked, one.covered) == (N, 40)


def test_only_poses_in_state_tracking_are_held_to_their_ellipse() -> None:
    one = track(ARC + np.where(T < 5, 100.0, 0.0)[:, None])
    one.poses["state"][:50] = State.AMBIGUOUS
    assert (scored(one).tracked, scored(one).covered) == (51, 51)
    assert scored(one).tracking_after_s == pytest.approx(5.0)
    assert scored(one).tracking_share == pytest.approx(0.5)
    assert scored(one).worst_sigma == 0.0


def test_a_singular_ellipse_contains_nothing() -> None:
    one = scored(track(ARC + 0.1, std=0.0))
    assert one.covered == 0
    assert one.worst_sigma == math.inf


def test_the_score_of_the_second_half_ignores_the_first() -> None:
    one = scored(track(ARC + np.where(T < 4.9, 8.0, 0.0)[:, None]))
    assert one.second_half == pytest.approx(0.0)
    assert one.rmse > 4.0


def test_a_turned_track_is_right_up_to_rotation_and_wrong_without() -> None:
    one = scored(track(turned(ARC, 1.0)))
    assert one.rotated == pytest.approx(0.0, abs=1e-9)
    assert one.rmse > 5.0
    assert one.covered < N


def test_a_mirrored_track_is_wrong_even_up_to_rotation() -> None:
    assert scored(track(ARC * [1.0, -1.0] + [4.0, 9.0])).rotated > 1.0


def test_without_north_a_turned_track_is_judged_in_its_own_frame() -> None:
    one = scored(track(shifted(turned(ARC, 2.5), 0.0, 0.01), std=0.1), no_north=True)
    assert one.rmse < 0.02
    assert one.end < 0.05
    assert (one.tracked, one.covered) == (N, N)


def test_without_north_the_frame_is_that_of_the_tracking_poses() -> None:
    found = turned(ARC, 0.5)
    found[:50] = turned(ARC, -2.0)[:50]
    one = track(found)
    one.poses["state"][:50] = State.AMBIGUOUS
    assert scored(one, no_north=True).worst_sigma == pytest.approx(0.0, abs=1e-9)


def test_the_rotation_turns_about_the_anchor_and_fits_the_used_rows_only() -> None:
    found = turned(ARC, 0.7)
    found[60:] = 1000.0
    used = np.arange(N) < 60
    np.testing.assert_allclose(rotated_onto(ARC, found, used, ANCHOR)[used], found[used], atol=1e-9)


def test_a_tag_without_a_position_at_the_end_is_lost() -> None:
    one = track(ARC)
    one.poses["x"][-1] = np.nan
    assert scored(one).end == math.inf
    assert summary([scored(one), scored(track(ARC))], 1.0).lost == 0.5


def test_a_tag_that_is_lost_is_two_metres_off_at_the_end() -> None:
    ends = [np.linspace(0.0, end, N)[:, None] * [1.0, 0.0] for end in (1.9, 2.1, 30.0)]
    assert summary([scored(track(ARC + end)) for end in ends], 1.0).lost == pytest.approx(2 / 3)


def test_a_tag_without_any_position_is_lost_and_never_tracked() -> None:
    one = scored(track(np.full((N, 2), np.nan), state=State.INITIALISING))
    row = summary([one], 1.0)
    assert (row.lost, row.never, row.tracking_share) == (1.0, 1.0, 0.0)
    assert row.rmse == (math.inf, math.inf)
    assert math.isnan(row.coverage)
    assert math.isnan(row.worst_sigma)


def test_a_row_pools_tracking_poses_and_takes_medians_of_tags() -> None:
    quiet = track(shifted(ARC, 0.1), state=State.AMBIGUOUS)
    tags = [scored(track(shifted(ARC, error))) for error in (0.2, 0.4, 3.0)]
    row = summary([*tags, scored(quiet)], 12.0)
    assert row.tags == 4
    assert row.rmse[0] == pytest.approx(0.3)
    assert row.coverage == pytest.approx(2 / 3)
    assert row.worst_sigma == pytest.approx(3.0)
    assert (row.tracking_after_s, row.never, row.us) == (0.0, 0.25, 12.0)


def test_half_of_the_tags_that_never_track_make_the_median_time_infinite() -> None:
    never, at_once = scored(track(ARC, state=State.AMBIGUOUS)), scored(track(ARC))
    assert summary([never, at_once], 1.0).tracking_after_s == math.inf
    with pytest.raises(ValueError, match="at least one"):
        summary([], 1.0)

"""A tag in a hand: what its steps teach, how it may be held, and when it is taken for carried."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from dropanchor_evaluation.product.rows import selected, simulated_rows
from dropanchor_evaluation.product.runs import TagRun, sources, tag_run
from dropanchor_evaluation.product.work import Result, run_row, run_tags
from dropanchor_service.estimation.columns import Motion
from dropanchor_service.estimation.fleet.belief.births.carrying import (
    ANY_DIRECTION_VAR,
    follow_motion,
    start_carried,
    turn_device,
    was_walked_off,
)
from dropanchor_service.estimation.fleet.belief.layout import (
    GAIT_OFFSET,
    MOUNT,
    OWN_ERROR,
    PHI,
    REFERENCE,
    ROW,
    SLIP,
    STEP_SCALE,
    YAW,
    N,
    R,
    V,
)
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, MEASURED_HEADING, RELATIVE_HEADING
from dropanchor_service.estimation.fleet.measurement.steps import update_gait_angle, update_step_speed
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import STATE, hypothesis_of, node_of

SEEDS = range(5910, 5918)
POCKETS = [5104, 5109, 5113]  # of which the device swings far when its steps are recognised
FIRST_STEPS = [5110, 5113, 5116, 5126, 5127, 5131, 5135, 5143, 5159, 5167, 5174, 5274]
T = Tuning()


def covariance() -> Any:
    A = np.random.default_rng(3).standard_normal((N, N)) * 0.05
    return A @ A.T + np.diag(np.full(N, 1e-3))


def kalman(s: Any, P: Any, h: Any, e: float, variance: float) -> tuple[Any, Any]:
    """Return the textbook Joseph form."""
    K = P @ h / (h @ P @ h + variance)
    L = np.eye(N) - np.outer(K, h)
    return s + K * e, L @ P @ L.T + variance * np.outer(K, K)


def walking_state() -> Any:
    s = STATE.copy()
    s[V], s[MOUNT], s[SLIP], s[GAIT_OFFSET], s[STEP_SCALE] = 1.3, 0.4, 0.1, -0.2, 0.08
    return s


def test_the_speed_of_the_steps_is_the_kalman_filter_of_speed_times_scale() -> None:
    s, P, h = walking_state(), covariance(), np.zeros(N)
    h[V], h[STEP_SCALE] = math.exp(0.08), 1.3 * math.exp(0.08)
    z, e = 1.5, 1.5 - 1.3 * math.exp(0.08)
    expected = kalman(s, P, h, e, max(T.step_speed_share * z, T.step_speed_std) ** 2)
    one, scratch = hypothesis_of(s, P)
    update_step_speed(one, scratch, z, T.record()[0])
    np.testing.assert_allclose(one["mean"], expected[0], atol=1e-12)
    np.testing.assert_allclose(one["cov"], expected[1], atol=1e-12)


def test_the_direction_of_the_steps_turns_the_course_towards_it_and_prefers_who_walks_there() -> None:
    ahead, scratch = hypothesis_of(walking_state(), covariance())
    likely = update_gait_angle(ahead, scratch, 0.4, T.record()[0])
    assert ahead["mean"][MOUNT] > 0.4
    across, scratch = hypothesis_of(walking_state(), covariance())
    assert update_gait_angle(across, scratch, 0.3 + math.pi / 2, T.record()[0]) < likely - 1.0


def row_of_a_walk(walked: float) -> tuple[Any, Any, Any]:
    """A row whose tag stood at (10, 0), its one hypothesis there, and a node after so many metres of steps."""
    row, work, node = np.zeros(1, ROW)[0], make_workspace()[0]["hypotheses"], node_of()
    row["publication"]["resolved"] = 1
    row["settings"]["mount_angle_std"] = 0.5
    row["walk"]["x"], row["walk"]["var"] = 10.0, 0.01
    node["dyaw"] = 0.0
    work[0]["mean"][:] = 0.0
    work[0]["mean"][R] = 10.0
    work[0]["cov"][:] = np.eye(N) * 0.01
    work[0]["log_weight"] = 0.0
    node["carried"], node["walked"] = 1, walked
    return row, work, node


def test_a_device_that_is_picked_up_may_be_held_in_any_way_and_its_carrier_is_where_the_steps_led() -> None:
    row, work, node = row_of_a_walk(2.0)
    count = follow_motion(work, 1, row, node, T.record()[0])
    assert count == T.grips
    mount = work["mean"][:count, MOUNT]
    np.testing.assert_allclose(np.sort(mount % (2 * math.pi)), 2 * math.pi * np.arange(count) / count, atol=1e-9)
    assert mount[work["log_weight"][:count].argmax()] == 0.0
    r, phi = work["mean"][:count, R], work["mean"][:count, PHI]
    np.testing.assert_allclose(r * np.cos(phi), 10.0 + 2.0 * np.cos(mount), atol=1e-9)
    np.testing.assert_allclose(r * np.sin(phi), 2.0 * np.sin(mount), atol=1e-9)


def test_a_turn_of_the_device_in_the_node_of_the_pick_up_turns_where_the_steps_led_as_it_turns_the_course() -> None:
    row, work, node = row_of_a_walk(2.0)
    node["dyaw"] = 2.0
    count = follow_motion(work, 1, row, node, T.record()[0])
    course = node["dyaw"] + work["mean"][:count, MOUNT]
    r, phi = work["mean"][:count, R], work["mean"][:count, PHI]
    np.testing.assert_allclose(r * np.cos(phi), 10.0 + 2.0 * np.cos(course), atol=1e-9)
    np.testing.assert_allclose(r * np.sin(phi), 2.0 * np.sin(course), atol=1e-9)


def test_who_is_carried_from_a_given_start_may_be_held_in_any_way_there() -> None:
    row, work, node = row_of_a_walk(0.0)
    row["start"]["known"], row["publication"]["resolved"] = 1, 0
    row["walk"]["x"], row["walk"]["var"] = 0.0, 0.0
    assert start_carried(work, 1, row, node, T.record()[0]) == T.grips
    np.testing.assert_allclose(work["mean"][: T.grips, R], 10.0)
    np.testing.assert_allclose(work["mean"][: T.grips, PHI], 0.0)


@pytest.mark.parametrize("known", [0, 1])
def test_who_walks_off_before_anything_is_certain_starts_again_only_where_no_start_was_told(known: int) -> None:
    row, _, node = row_of_a_walk(2.0)
    row["start"]["known"], row["publication"]["resolved"] = known, 0
    assert was_walked_off(row, node, T.record()[0]) == (known == 0)


def test_what_a_vehicle_took_for_an_error_of_the_platforms_heading_is_forgotten() -> None:
    row, work, node = row_of_a_walk(2.0)
    row["heading"]["models_started"], row["heading"]["model"] = 1, 1
    work[0]["heading_class"] = OWN_ERROR
    work[0]["mean"][YAW], work[0]["mean"][REFERENCE] = -2.0, 6.0
    node["heading_kind"], node["heading"], node["heading_var"], node["dyaw"] = MEASURED_HEADING, 1.0, 0.01, 0.3
    count = follow_motion(work, 1, row, node, T.record()[0])
    np.testing.assert_allclose(work["mean"][:count, YAW] + node["dyaw"], 1.0)
    np.testing.assert_array_equal(work["mean"][:count, REFERENCE], 0.0)
    np.testing.assert_array_equal(work["heading_class"][:count], 0)
    assert (row["heading"]["models_started"], row["heading"]["model"]) == (0, 0)


@pytest.mark.parametrize(
    ("upright", "heading_kind", "start_heading", "any_direction"),
    [
        (1, RELATIVE_HEADING, 1.0, True),
        (1, MEASURED_HEADING, math.nan, True),
        (1, ABSOLUTE_HEADING, math.nan, False),
        (0, RELATIVE_HEADING, 1.0, False),
    ],
)
def test_steps_may_point_anywhere_beside_a_heading_that_is_told_of_a_device_whose_x_axis_is_upright(
    upright: int, heading_kind: int, start_heading: float, any_direction: bool
) -> None:
    row, work, node = row_of_a_walk(2.0)
    row["start"]["heading"], node["upright"], node["heading_kind"] = start_heading, upright, heading_kind
    count = follow_motion(work, 1, row, node, T.record()[0])
    expected = ANY_DIRECTION_VAR if any_direction else T.gait_offset_std**2
    np.testing.assert_array_equal(work["cov"][:count, GAIT_OFFSET, GAIT_OFFSET], expected)


def test_a_known_mounting_angle_is_kept() -> None:
    row, work, node = row_of_a_walk(1.0)
    row["settings"]["mount_angle_std"] = 0.02
    assert follow_motion(work, 1, row, node, T.record()[0]) == 1
    assert work["mean"][0, MOUNT] == 0.0


def test_bumps_of_a_fast_vehicle_are_no_steps() -> None:
    row, work, node = row_of_a_walk(1.0)
    work["mean"][0, V] = 5.0
    assert follow_motion(work, 1, row, node, T.record()[0]) == 1
    assert (row["walk"]["carried"], node["carried"]) == (0, 0)


def test_after_a_quick_turn_the_device_may_have_turned_and_not_its_carrier() -> None:
    _, work, node = row_of_a_walk(0.0)
    node["turned"] = 1.5
    assert turn_device(work, 1, node, T.record()[0]) == 2
    course = work["mean"][:2, YAW] + work["mean"][:2, MOUNT]
    assert course[0] - course[1] == pytest.approx(1.5)


def runs_of(name: str, motion: Motion = Motion.AUTO, seeds: Sequence[int] = SEEDS) -> tuple[Any, list[TagRun]]:
    (row,) = selected(simulated_rows(), [name])
    runs = [tag_run(row, one) for one in sources(row, seeds)]
    for run in runs:
        run.settings["motion"] = motion
    return row, runs


def result_of(name: str, motion: Motion = Motion.AUTO, seeds: Sequence[int] = SEEDS) -> Result:
    return run_row(*runs_of(name, motion, seeds))


def carried(name: str, motion: Motion) -> Any:
    """Whether each tag is taken for carried at the end."""
    engine = FleetEngine()
    run_tags(engine, runs_of(name, motion)[1])
    return engine.state()["rows"]["walk"]["carried"] == 1


@pytest.mark.parametrize(
    ("name", "motion", "expected"),
    [
        ("walk-hand/6-axis/nothing/known", Motion.AUTO, True),
        ("walk-pocket/6-axis/nothing/known", Motion.AUTO, True),
        ("walk-hand/6-axis/nothing/known", Motion.VEHICLE, False),
        ("M5/9-axis/nothing/known", Motion.AUTO, False),
        ("forklift/9-axis/nothing/known", Motion.AUTO, False),
        ("rolling/9-axis/nothing/known", Motion.CARRIED, True),
    ],
)
def test_steps_or_the_setting_decide_whether_a_tag_is_carried(name: str, motion: Motion, expected: bool) -> None:
    assert (carried(name, motion) == expected).all()


def test_without_steps_auto_gives_the_poses_of_a_vehicle_to_the_last_bit() -> None:
    tracks = [
        run_tags(FleetEngine(), runs_of("C5/9-axis/nothing/known", motion)[1])[0]
        for motion in (Motion.AUTO, Motion.VEHICLE)
    ]
    for auto, vehicle in zip(*tracks, strict=True):
        assert auto.poses.tobytes() == vehicle.poses.tobytes()


@pytest.mark.parametrize(("carry", "limit"), [("hand", 3.0), ("turned", 6.0)])
def test_a_walk_is_followed_and_the_ellipse_holds_the_truth_while_tracking(carry: str, limit: float) -> None:
    score = result_of(f"walk-{carry}/6-axis/nothing/known").score
    assert score.rmse[0] < limit
    assert score.coverage >= 0.93
    assert score.tracking_share > 0.25


def test_a_walk_with_a_device_in_a_pocket_begins_where_it_stood() -> None:
    result = result_of("walk-pocket/6-axis/nothing/known", seeds=POCKETS)
    assert max(tag.worst_sigma for tag in result.tags) < 5.0
    assert result.score.coverage >= 0.93


@pytest.mark.parametrize("sensors", ["9-axis", "6-axis"])
def test_a_walk_with_a_device_in_a_pocket_is_not_mirrored_at_the_line_to_the_anchor(sensors: str) -> None:
    result = result_of(f"walk-pocket/{sensors}/nothing/known", seeds=[5112, 5137])
    assert max(tag.worst_sigma for tag in result.tags) < 5.0
    assert result.score.coverage > 0.95


def test_what_looks_like_a_step_after_a_rest_makes_the_place_ambiguous_before_the_model_of_a_vehicle_is_wrong() -> None:
    result = result_of("walk-pocket/6-axis/nothing/known", seeds=FIRST_STEPS)
    assert max(tag.worst_sigma for tag in result.tags) < 5.0


def test_a_walk_with_a_device_in_a_pocket_follows_the_platforms_heading() -> None:
    assert result_of("walk-pocket/scalar/nothing/known", seeds=[5207, 5213, 5226, 5232]).score.coverage > 0.9


def test_what_a_vehicle_would_have_done_does_not_outlive_the_first_steps() -> None:
    result = result_of("walk-pocket/6-axis/nothing/unknown", seeds=[5112, 5124, 5125, 5126])
    assert max(tag.worst_sigma for tag in result.tags) < 5.0


def test_a_tag_that_is_said_to_be_carried_tracks_from_its_start() -> None:
    score = result_of("walk-hand/6-axis/nothing/known", Motion.CARRIED).score
    assert score.rmse[0] < 4.0
    assert score.coverage >= 0.93
    assert score.tracking_share > 0.7

"""Motions are kinematically consistent, reproducible, and true to the parameters of their family."""

import math
from collections.abc import Callable
from dataclasses import fields

import numpy as np
import pytest
from numpy.typing import NDArray

from dropanchor_tag_client.simulator.families import Wandering
from dropanchor_tag_client.simulator.scenarios import (
    FAMILIES,
    MAX_DISTANCE_M,
    MIN_DISTANCE_M,
    SCENARIOS,
    UnknownScenarioError,
    trajectory,
)
from dropanchor_tag_client.simulator.shapes import STAGE_SPEEDS, STAGE_STARTS
from dropanchor_tag_client.simulator.trajectory import Array, Segment, Start, Trajectory, drive

SEEDS = range(25)


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return [first, last) of each stretch where the mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def cruising(motion: Trajectory) -> list[Trajectory]:
    """Return the stretches of constant speed and yaw rate that last more than 2 s."""
    steady = (np.abs(np.diff(motion.v, prepend=0)) < 1e-9) & (np.abs(np.diff(motion.w, prepend=0)) < 1e-9)
    return [
        Trajectory(*(getattr(motion, f.name)[first:last] for f in fields(motion)))
        for first, last in runs(steady)
        if (last - first) * motion.dt > 2.0
    ]


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_same_seed_gives_the_same_motion(scenario: str) -> None:
    first, again = trajectory(scenario, 7), trajectory(scenario, 7)
    assert all(np.array_equal(getattr(first, f.name), getattr(again, f.name)) for f in fields(first))


@pytest.mark.parametrize("scenario", FAMILIES)
def test_another_seed_gives_another_motion(scenario: str) -> None:
    assert not np.array_equal(trajectory(scenario, 1).course[-500:], trajectory(scenario, 2).course[-500:])


@pytest.mark.parametrize("scenario", [s for s in SCENARIOS if s != "fig3-straight"])
def test_velocity_integrates_to_position_and_yaw_rate_to_course(scenario: str) -> None:
    motion = trajectory(scenario, 3)
    for position, direction in ((motion.x, np.cos), (motion.y, np.sin)):
        velocity = motion.v * direction(motion.course)
        integral = np.concatenate([[0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2 * motion.dt)])
        assert position - position[0] == pytest.approx(integral, abs=0.02)
    turned = np.concatenate([[0.0], np.cumsum((motion.w[1:] + motion.w[:-1]) / 2 * motion.dt)])
    assert motion.course - motion.course[0] == pytest.approx(turned, abs=1e-9)
    assert motion.travelled[-1] == pytest.approx(np.hypot(np.diff(motion.x), np.diff(motion.y)).sum(), rel=1e-3)


def test_a_constant_arc_is_exactly_a_circle() -> None:
    motion = drive([Segment(20.0, 2.0, 0.4, ramp_s=0.0)], Start(0.0, -5.0, 0.0), 0.05, Segment(0.0, 2.0, 0.4))
    assert motion.distance == pytest.approx(np.full(len(motion), 5.0), abs=1e-12)


@pytest.mark.parametrize("scenario", FAMILIES)
def test_families_start_at_rest_at_ten_metres_and_keep_their_distance(scenario: str) -> None:
    for seed in SEEDS:
        motion = trajectory(scenario, seed)
        assert (motion.x[0], motion.y[0], motion.v[0]) == (10.0, 0.0, 0.0)
        assert np.all(motion.v[motion.t < 0.995] == 0.0)
        assert motion.distance.min() >= MIN_DISTANCE_M
        assert motion.distance.max() <= MAX_DISTANCE_M


def test_s5_is_five_straight_legs_of_distinct_speeds() -> None:
    for seed in SEEDS:
        legs = [leg for leg in cruising(trajectory("S5", seed)) if leg.v[0] > 0]
        speeds = [leg.v[0] for leg in legs]
        assert len(legs) == 5
        assert all(0.5 <= speed <= 4.0 for speed in speeds)
        assert np.all(np.abs(np.diff(speeds)) >= 0.4)
        assert all(np.ptp(leg.course) < 1e-9 and 7.4 < leg.t[-1] - leg.t[0] < 14.0 for leg in legs)
        turns = np.abs(np.diff([leg.course[0] for leg in legs]))
        assert np.all((turns > 0.299) & (turns < 2.2))


def test_m5_mixes_lines_and_arcs_in_equal_parts() -> None:
    legs = [leg for seed in range(60) for leg in cruising(trajectory("M5", seed)) if leg.v[0] > 0]
    rates = np.array([leg.w[0] for leg in legs])
    arcs = np.abs(rates) > 1e-9
    assert 0.4 < arcs.mean() < 0.6
    assert np.all((np.abs(rates[arcs]) >= 0.1) & (np.abs(rates[arcs]) <= 0.5))
    assert {-1.0, 1.0} == set(np.sign(rates[arcs]))


def test_slow_carts_are_slow() -> None:
    for seed in SEEDS:
        motion = trajectory("C5", seed)
        assert motion.v.max() <= 1.2
        assert np.abs(cruising(motion)[-1].w).max() <= 0.35


def test_stop_and_go_stops_four_times_for_three_to_six_seconds() -> None:
    for seed in SEEDS:
        motion = trajectory("SG", seed)
        stops = runs(motion.v == 0.0)[1:]
        assert len(stops) == 4
        assert all(2.97 <= (last - first) * motion.dt <= 6.02 for first, last in stops)


def test_reverse_drives_the_second_and_fourth_leg_backwards() -> None:
    for seed in SEEDS:
        legs = [leg.v[0] for leg in cruising(trajectory("RV", seed)) if leg.v[0] != 0]
        assert np.sign(legs).tolist() == [1, -1, 1, -1, 1]


def test_the_single_line_is_one_line_of_forty_seconds() -> None:
    for seed in SEEDS:
        motion = trajectory("L1", seed)
        assert np.ptp(motion.course) == 0.0
        assert motion.t[-1] == pytest.approx(41.0)


def test_the_random_walk_has_its_mean_and_deviation() -> None:
    """Draw without the distance limits, which would select slow motions."""
    late = [Wandering().draw(np.random.default_rng(seed)) for seed in range(300)]
    speeds = np.concatenate([motion.v[3000:] for motion in late])
    rates = np.concatenate([motion.w[3000:] for motion in late])
    clipped_mean = 1.5 + 0.8 * (math.exp(-(1.875**2) / 2) / math.sqrt(math.tau) - 1.875 * 0.0304)
    assert speeds.min() == 0.0
    assert speeds.mean() == pytest.approx(clipped_mean, abs=0.08)
    assert np.median(speeds) == pytest.approx(1.5, abs=0.1)
    assert rates.std() == pytest.approx(0.35, rel=0.08)


def test_the_paper_s_stages_have_the_released_values() -> None:
    motion = trajectory("P", 0)
    assert motion.dt == pytest.approx(0.005)
    assert [motion.v[first + 60] for first in STAGE_STARTS] == pytest.approx(STAGE_SPEEDS)
    assert not motion.v[: STAGE_STARTS[0] + 1].any()
    turns = np.diff([motion.course[first + 60] for first in (0, *STAGE_STARTS)])
    assert turns == pytest.approx([peak * 0.25 * 2 / math.pi for peak in (4.7, 6.1, 3.5, 5.0, 7.1)], rel=1e-3)
    assert motion.course[0] == math.pi / 2


def test_fig4_goes_from_ten_metres_east_250_metres_north() -> None:
    motion = trajectory("fig4", 0)
    assert (motion.x[-1], motion.y[-1]) == pytest.approx((10.0, 250.0))


@pytest.mark.parametrize(("scenario", "corners"), [("triangle", 4), ("TUM", 13)])
def test_polylines_reach_their_corners(scenario: str, corners: int) -> None:
    motion = trajectory(scenario, 0)
    ends = [first for first, _ in runs(motion.v == 0.0)]
    assert len(ends) == corners
    assert motion.v.max() == {"triangle": 2.0, "TUM": 0.8}[scenario]
    expected = {"triangle": (8.0, -6.0), "TUM": (-2.0, 2.0)}[scenario]
    assert (motion.x[-1], motion.y[-1]) == pytest.approx(expected, abs=0.02)


def test_straight_stages_of_fig3_have_no_yaw_rate_but_at_changes() -> None:
    assert np.count_nonzero(trajectory("fig3-straight", 0).w) == 9
    assert np.count_nonzero(trajectory("fig3-arcs", 0).w) == 4500


def test_a_rest_before_a_motion_only_delays_it() -> None:
    motion = trajectory("S5", 1)
    later = motion.after_rest(2.0)
    assert later.x[200:] == pytest.approx(motion.x)
    assert np.all(later.x[:200] == 10.0)
    assert later.t[-1] == pytest.approx(motion.t[-1] + 2.0)


@pytest.mark.parametrize("name", ["", "s5", "M6"])
def test_an_unknown_scenario_is_an_error_that_lists_the_valid_names(name: str) -> None:
    with pytest.raises(UnknownScenarioError, match=r"there are P, .*S5"):
        trajectory(name, 0)


@pytest.mark.parametrize("column", [np.cos, np.sin])
def test_a_turn_on_the_spot_does_not_move(column: Callable[[Array], Array]) -> None:
    motion = drive([Segment(2.0, 0.0, turn=1.5, ramp_s=1.5)], Start(3.0, 4.0, 0.0), 0.01)
    assert np.all((motion.x == 3.0) & (motion.y == 4.0))
    assert column(motion.course[-1]) == pytest.approx(column(np.array(1.5)), abs=1e-3)

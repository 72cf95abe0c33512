"""Whether a mount is rigid or loose, by what its sideways axis measures."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import default_settings
from dropanchor_service.estimation.fleet.belief.layout import ACC_BIAS, GYRO_BIAS, LEFT_BIAS, MOUNT, SLIP, N, V
from dropanchor_service.estimation.fleet.belief.rigidity import (
    RIGID_SLIP,
    decide_mount,
    is_askew,
    judge_mount,
    slip_std_of,
    tells_course,
    weight_power,
)
from dropanchor_service.estimation.fleet.configure import configure_row
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import STATE, hypothesis_of, node_of

DT = 0.1  # s
TUNING = Tuning().record()[0]


def row_of(resolved: bool = True, slip_std: float = math.nan, mount_angle: float = math.nan) -> Any:
    settings = default_settings()
    settings["mount_angle"] = mount_angle
    settings["slip_std"] = slip_std
    configured = configure_row(settings, Tuning())
    rows = np.zeros(1, configured.dtype)
    rows[0] = configured
    rows[0]["publication"]["resolved"] = resolved
    return rows[0]


def course_keeping(speed: float) -> Any:
    s = STATE.copy()
    s[V], s[MOUNT], s[SLIP], s[GYRO_BIAS], s[ACC_BIAS], s[LEFT_BIAS] = speed, 0.0, 0.0, 0.0, 0.0, 0.0
    return s


def slipping(slip: float) -> Any:
    s = course_keeping(2.0)
    s[SLIP] = slip
    return s


def drive(row: Any, slip_std: float, speed: float = 2.0, seconds: float = 20.0, bumps: float = 0.0) -> None:
    """Judge a slalom at constant speed whose course wanders about the body axis as an Ornstein-Uhlenbeck process."""
    rng, tau, slip = np.random.default_rng(11), row["settings"]["slip_tau"], 0.0
    decay = math.exp(-DT / tau)
    for k in range(round(seconds / DT)):
        turn = 0.1 * math.sin(0.3 * k)
        step = slip * (decay - 1.0) + rng.normal(0.0, slip_std * math.sqrt(1.0 - decay**2))
        slip += step
        turned = turn + step  # of the course
        node = node_of(
            dt=DT,
            dyaw=turn,
            forward=speed * (math.cos(turned) - 1.0),
            left=speed * math.sin(turned) + rng.normal(0.0, bumps),
        )
        one, scratch = hypothesis_of(course_keeping(speed), np.diag(np.full(N, 1e-6)))
        judge_mount(one, scratch, node, row)
        decide_mount(np.array([one]), 1, row, TUNING, scratch)


def test_a_mount_that_does_not_wander_is_found_rigid_and_its_slip_small() -> None:
    row = row_of()
    assert slip_std_of(row) == pytest.approx(0.1)
    drive(row, slip_std=0.0)
    assert slip_std_of(row) == RIGID_SLIP


def test_a_mount_that_wanders_stays_loose_and_one_that_comes_loose_is_noticed() -> None:
    row = row_of()
    drive(row, slip_std=0.1)
    assert slip_std_of(row) == pytest.approx(0.1)
    row = row_of()
    drive(row, slip_std=0.0)
    drive(row, slip_std=0.1)
    assert slip_std_of(row) == pytest.approx(0.1)


def test_a_tag_that_creeps_tells_nothing_of_its_mount() -> None:
    row = row_of()
    drive(row, slip_std=0.0, speed=0.3, seconds=120.0)
    assert row["mount"]["rigid_log_odds"] == 0.0
    assert slip_std_of(row) == pytest.approx(0.1)


def test_a_slip_that_the_operator_gave_stays() -> None:
    row = row_of(slip_std=0.1)
    drive(row, slip_std=0.0)
    assert slip_std_of(row) == pytest.approx(0.1)


def test_a_tag_that_sways_more_than_a_rigid_mount_does_stops_teaching_sideways() -> None:
    calm, shaken = row_of(), row_of()
    drive(calm, slip_std=0.0, seconds=10.0, bumps=0.01)
    drive(shaken, slip_std=0.0, seconds=10.0, bumps=0.3)
    assert tells_course(calm)
    assert not tells_course(shaken)


def test_while_hypotheses_compete_a_mount_may_be_found_rigid_but_not_shaken() -> None:
    row = row_of(resolved=False)
    drive(row, slip_std=0.0)
    assert slip_std_of(row) == RIGID_SLIP
    row = row_of(resolved=False)
    drive(row, slip_std=0.0, bumps=0.3)
    assert tells_course(row)
    assert slip_std_of(row) == pytest.approx(0.1)


def test_a_mount_is_not_found_rigid_while_its_sideways_axis_tells_of_jolts() -> None:
    row = row_of()
    row["mount"]["rigid_log_odds"] = 10.0
    drive(row, slip_std=0.0, seconds=1.0, bumps=0.3)
    assert not tells_course(row)
    assert slip_std_of(row) == pytest.approx(0.1)


def test_what_a_hypothesis_took_for_slip_is_its_mounting_angle_when_the_mount_is_found_rigid() -> None:
    row = row_of()
    row["mount"]["rigid_log_odds"] = 10.0
    s, P = STATE.copy(), np.zeros((N, N))
    s[MOUNT], s[SLIP] = 0.2, 0.1
    P[MOUNT, MOUNT], P[SLIP, SLIP] = 0.25, 0.01
    P[MOUNT, SLIP] = P[SLIP, MOUNT] = -0.0099  # their sum is known, and each of them is not
    one, scratch = hypothesis_of(s, P)
    work = np.array([one])
    decide_mount(work, 1, row, TUNING, scratch)
    assert work[0]["mean"][MOUNT] == pytest.approx(0.3, abs=0.02)
    assert abs(work[0]["mean"][SLIP]) < 0.01
    assert work[0]["cov"][SLIP, SLIP] < RIGID_SLIP**2


@pytest.mark.parametrize(("told", "weighed"), [(math.nan, True), (0.2, False)])
def test_a_hypothesis_loses_the_weight_that_it_owes_to_a_slip_where_nobody_told_the_angle(
    told: float, weighed: bool
) -> None:
    row = row_of(mount_angle=told)
    row["mount"]["rigid_log_odds"] = 10.0
    P = np.diag(np.full(N, 1e-4))
    work = np.concatenate([np.atleast_1d(hypothesis_of(slipping(slip), P)[0]) for slip in (0.0, -0.4)])
    decide_mount(work, 2, row, TUNING, hypothesis_of(STATE, P)[1])
    assert row["mount"]["rigid"] == 1
    assert bool(work[0]["log_weight"] > work[1]["log_weight"] + 10.0) is weighed


@pytest.mark.parametrize(
    ("told", "rigid", "weighs"), [(math.nan, True, True), (math.nan, False, False), (0.2, True, False)]
)
def test_the_sideways_axis_weighs_only_on_a_rigid_mount_that_nobody_told(
    told: float, rigid: bool, weighs: bool
) -> None:
    assert (weight_power(row_of(mount_angle=told), rigid, TUNING) > 0.0) is weighs


def speed_up_and_brake(row: Any, askew: float, jolts: float = 0.0, seconds: float = 10.0) -> None:
    """Judge a straight drive at changing speed on a mount that is `askew` rad off the angle of the belief."""
    rng = np.random.default_rng(12)
    for k in range(round(seconds / DT)):
        change = 0.2 * math.sin(0.4 * k)
        left = change * -math.sin(askew) + rng.normal(0.0, jolts)
        node = node_of(dt=DT, dyaw=0.0, forward=change * math.cos(askew), left=left)
        one, scratch = hypothesis_of(course_keeping(2.0), np.diag(np.full(N, 1e-6)))
        judge_mount(one, scratch, node, row)


@pytest.mark.parametrize("askew", [-0.9, 0.6])
def test_a_mount_that_is_another_than_believed_shows_in_each_change_of_the_speed(askew: float) -> None:
    row = row_of()
    speed_up_and_brake(row, askew)
    assert is_askew(row)
    assert tells_course(row)  # so that the belief may learn the angle


def test_neither_a_right_mounting_angle_nor_jolts_are_taken_for_another_angle() -> None:
    right, jolted = row_of(), row_of()
    speed_up_and_brake(right, 0.0)
    speed_up_and_brake(jolted, 0.0, jolts=0.2)
    assert jolted["mount"]["lateral_misfit"] > 2.0
    assert not is_askew(right)
    assert not is_askew(jolted)
    assert not tells_course(jolted)

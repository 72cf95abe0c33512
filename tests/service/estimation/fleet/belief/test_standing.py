"""A rest that is a smooth ride, and a tag that reverses though nobody said that it might."""

from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import State, default_settings
from dropanchor_service.estimation.fleet.belief.layout import PHI, V
from dropanchor_service.estimation.fleet.belief.pool import make_pool
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.configure import configure_row
from dropanchor_service.estimation.fleet.frontend.node import MOVING, RESTING
from dropanchor_service.estimation.fleet.measurement.rest import judge_standstill
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import node_of
from support.fleet_tracks import DT, Drive, rows_of, run, sense


def judged(*speeds: tuple[float, float, float], quiet_share: float | None = None) -> int:
    """Return what a node of rest is after it was judged. speeds: weight, m/s and its deviation of each hypothesis."""
    rows = np.zeros(1, configure_row(default_settings(), Tuning()).dtype)
    rows[0] = configure_row(default_settings(), Tuning())
    if quiet_share is not None:
        rows[0]["quiet_share"] = quiet_share
    work = make_workspace()[0]["hypotheses"]
    for one, (weight, speed, std) in zip(work, speeds, strict=False):
        one["mean"][V], one["cov"][V, V], one["log_weight"] = speed, std**2, np.log(weight)
    node = node_of()
    node["rest"] = RESTING
    judge_standstill(work, len(speeds), rows[0], node, Tuning())
    return int(node["rest"])


@pytest.mark.parametrize(
    ("speed", "std", "rest"),
    [(2.0, 0.1, MOVING), (2.0, 2.0, RESTING), (0.05, 0.05, RESTING), (0.5, 0.1, MOVING), (0.5, 0.4, RESTING)],
)
def test_a_speed_that_is_far_from_zero_refutes_a_rest(speed: float, std: float, rest: int) -> None:
    assert judged((1.0, speed, std), quiet_share=0.05) == rest


def test_an_imu_that_was_never_seen_to_shake_says_less_of_a_rest() -> None:
    assert judged((1.0, 0.05, 0.05)) == RESTING
    assert judged((1.0, 0.5, 0.2)) == MOVING  # as a trolley that has just driven off smoothly
    assert judged((1.0, 0.5, 0.2), quiet_share=0.05) == RESTING


def test_a_tag_that_rides_without_vibration_needs_less_to_refute_a_rest() -> None:
    assert judged((1.0, 0.4, 0.17), quiet_share=0.005) == RESTING
    assert judged((1.0, 0.4, 0.17), quiet_share=0.9) == MOVING


def test_a_rest_that_another_hypothesis_explains_is_one() -> None:
    fast, slow = (0.6, 0.8, 0.2), (0.2, 0.15, 0.18)
    assert judged(fast, quiet_share=0.05) == MOVING
    assert judged(fast, slow, quiet_share=0.05) == RESTING


def there_and_back(seed: int, unconfirmed: int = 0) -> Drive:
    """Return a drive ahead, with a bend, a stop of 2 s, and back in another bend.

    unconfirmed: nodes at the beginning of each stop that do not say so.
    """
    rng = np.random.default_rng(seed)
    v = np.concatenate(
        [np.zeros(11), np.full(80, 1.5), np.zeros(20), np.full(60, -1.0), np.zeros(20), np.full(60, 1.2)]
    )
    w = np.concatenate([np.zeros(50), np.full(20, 0.4), np.zeros(41), np.full(60, 0.25), np.zeros(80)])
    smooth = np.convolve(np.concatenate([np.zeros(4), v]), np.full(5, 0.2), "valid")
    yaw = rng.uniform(-np.pi, np.pi) + np.concatenate([[0.0], np.cumsum(w[:-1]) * DT])
    middle, mean_v = yaw[:-1] + w[:-1] * DT / 2, (smooth[:-1] + smooth[1:]) / 2
    x = 10.0 + np.concatenate([[0.0], np.cumsum(mean_v * np.cos(middle)) * DT])
    y = np.concatenate([[0.0], np.cumsum(mean_v * np.sin(middle)) * DT])
    nodes = sense(rng, x, y, yaw, smooth, 0.1, 0)
    stands = (np.abs(smooth) < 1e-9) & (np.arange(len(x)) > 1)
    for k in range(unconfirmed):
        stands[1:] &= stands[:-1] | (np.arange(1, len(x)) < 12 + k)
    nodes["rest"] = np.where(stands, RESTING, MOVING)
    return Drive(nodes, x, y, smooth)


@pytest.mark.parametrize("unconfirmed", [0, 14])
def test_a_tag_that_reverses_after_a_stop_is_followed_though_nobody_said_that_it_may(unconfirmed: int) -> None:
    """A standstill is confirmed late: two tenths of a second of a stop are left."""
    errors: list[Any] = []
    for seed in range(3000, 3008):
        d = there_and_back(seed, unconfirmed)
        beliefs = run(rows_of(1, known=True), make_pool(512), d.nodes)
        errors.append(np.hypot(beliefs["x"] - d.x, beliefs["y"] - d.y).max())
        assert beliefs["speed"][150] == pytest.approx(-1.0, abs=0.3)
        assert beliefs["speed"][-1] == pytest.approx(1.2, abs=0.3)
        assert beliefs["state"][-1] == State.TRACKING
    assert np.median(errors) < 0.6


def test_a_tag_that_reverses_before_its_start_is_found_is_followed_as_well() -> None:
    for seed in (3000, 3001, 3007):
        d = there_and_back(seed)
        beliefs = run(rows_of(1, known=False), make_pool(512), d.nodes)
        assert beliefs["state"][100] != State.TRACKING  # when it turns back
        assert np.hypot(beliefs["x"] - d.x, beliefs["y"] - d.y)[-60:].max() < 1.0


def test_a_tag_that_may_reverse_is_followed_when_it_turns_back_without_a_stop() -> None:
    for seed in range(3000, 3004):
        d = there_and_back(seed)
        d.nodes["rest"][20:] = MOVING  # no standstill is seen
        rows = rows_of(1, known=True)
        rows["settings"]["reverse_allowed"] = 1
        beliefs = run(rows, make_pool(512), d.nodes)
        assert beliefs["speed"][150] == pytest.approx(-1.0, abs=0.3)
        assert beliefs["speed"][-1] == pytest.approx(1.2, abs=0.3)
        assert np.hypot(beliefs["x"] - d.x, beliefs["y"] - d.y).max() < 1.0


def test_an_accelerometer_that_clearly_refuses_the_direction_is_believed_without_a_seen_stop() -> None:
    errors = []
    for seed in range(3000, 3006):
        d = there_and_back(seed)
        d.nodes["rest"][20:] = MOVING  # no standstill is seen
        beliefs = run(rows_of(1, known=True), make_pool(512), d.nodes)
        errors.append(np.hypot(beliefs["x"] - d.x, beliefs["y"] - d.y).max())
    assert np.median(errors) < 1.2


def test_a_tag_that_is_seen_to_stand_starts_before_it_drives_off() -> None:
    """Once it drives, a ring would have to guess its speed."""
    rows, pool = rows_of(1, known=False), make_pool(512)
    run(rows, pool, there_and_back(3000).nodes[:8])
    speeds, slot = [], rows["first_slot"][0]
    for _ in range(rows["count"][0]):
        speeds.append(abs(pool[slot]["mean"][V]))
        slot = pool[slot]["next"]
    assert len(speeds) == Tuning().start_bearings
    assert max(speeds) < 0.02


def test_a_tag_that_stands_with_an_unknown_start_may_be_in_every_direction() -> None:
    """Ranges at 100 Hz that do not change favour speeds across the line of sight until the standstill is seen."""
    rng = np.random.default_rng(3000)
    nodes = np.repeat(there_and_back(3000).nodes[:1], 100)
    nodes["dt_s"], nodes["t_ns"] = 0.01, np.arange(100) * 10_000_000
    nodes["z"], nodes["rest"] = 10.0 + 0.1 * rng.standard_normal(100), np.where(np.arange(100) < 55, MOVING, RESTING)
    rows, pool = rows_of(1, known=False), make_pool(512)
    run(rows, pool, nodes)
    axis, slot = 0j, rows["first_slot"][0]
    for _ in range(rows["count"][0]):
        axis += np.exp(pool[slot]["log_weight"] + 2j * pool[slot]["mean"][PHI])
        slot = pool[slot]["next"]
    assert abs(axis) < 0.2  # 0 if all directions are equally likely, 1 if only one and its opposite are left

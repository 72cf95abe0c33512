"""A tag beside the point that follows the course."""

import math
from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import ANCHOR, IMU, RANGE, Array, SampleBatch, default_settings
from dropanchor_service.estimation.fleet.belief.layout import ROW
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.frontend.assembly import apply_lever
from dropanchor_service.estimation.fleet.frontend.node import NODE

G0 = 9.80665
STEP_S, RANGE_EVERY = 0.01, 10
LEVER = (0.6, -0.3)


def turn(angle: float) -> Array:
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def filled(rate_before: float, dyaw: float, lever: tuple[float, float] = LEVER) -> Any:
    rows, nodes = np.zeros(1, ROW), np.zeros(1, NODE)
    rows["settings"]["lever_x"], rows["settings"]["lever_y"], rows["lever_rate"] = *lever, rate_before
    nodes["dt_s"], nodes["dyaw"], nodes["dv_forward"], nodes["dv_left"] = 0.1, dyaw, 0.2, -0.1
    apply_lever(rows[0], nodes[0])
    return nodes[0]


def test_a_turn_swings_the_tag_about_its_pivot() -> None:
    node = filled(0.0, 0.2)
    expected = turn(0.2) @ LEVER - np.array(LEVER)
    np.testing.assert_allclose([node["swing_forward"], node["swing_left"]], expected, atol=1e-12)


def test_the_acceleration_of_a_swinging_tag_is_not_that_of_its_pivot() -> None:
    node = filled(1.5, 0.2)

    def velocity(rate: float) -> Array:
        return rate * np.array([-LEVER[1], LEVER[0]])

    expected = np.array([0.2, -0.1]) - (turn(0.2) @ velocity(2.0) - velocity(1.5))
    np.testing.assert_allclose([node["dv_forward"], node["dv_left"]], expected, atol=1e-12)


def test_without_a_lever_nothing_changes() -> None:
    node = filled(1.5, 0.2, (0.0, 0.0))
    assert [node[name] for name in ("swing_forward", "swing_left", "dv_forward", "dv_left")] == [0.0, 0.0, 0.2, -0.1]


def carried(seconds: float = 60.0) -> tuple[SampleBatch, Array]:
    """Return samples and track (n, 2) of a tag on an arm: 2 s of rest at (5, 0), then curves at 0.9 m/s."""
    rng = np.random.default_rng(7)
    t = np.arange(0.0, seconds, STEP_S)
    moving = np.clip((t - 2.0) / 1.0, 0.0, 1.0)
    rate = moving * (0.5 * np.sin(0.5 * t) + 0.7 * np.sin(0.23 * t + 1.0))
    yaw = np.cumsum(rate) * STEP_S
    pivot = np.cumsum(0.9 * moving[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], 1), axis=0) * STEP_S
    arm = np.stack(
        [np.cos(yaw) * LEVER[0] - np.sin(yaw) * LEVER[1], np.sin(yaw) * LEVER[0] + np.cos(yaw) * LEVER[1]], 1
    )
    tag = pivot + arm - arm[0] + [5.0, 0.0]
    felt = np.gradient(np.gradient(tag, STEP_S, axis=0), STEP_S, axis=0)
    imu = np.zeros(len(t), IMU)
    imu["t_ns"] = np.round(t * 1e9).astype(np.int64)
    imu["acc"][:, 0] = np.cos(yaw) * felt[:, 0] + np.sin(yaw) * felt[:, 1]
    imu["acc"][:, 1] = np.cos(yaw) * felt[:, 1] - np.sin(yaw) * felt[:, 0]
    imu["acc"] += [0.0, 0.0, G0] + (0.02 + 0.2 * moving[:, None]) * rng.standard_normal((len(t), 3))
    imu["gyro"][:, 2] = rate
    imu["gyro"] += 0.005 * rng.standard_normal((len(t), 3))
    imu["mag"] = np.nan
    ranges = np.zeros(len(t[::RANGE_EVERY]), RANGE)
    ranges["t_ns"] = imu["t_ns"][::RANGE_EVERY]
    ranges["range"] = np.hypot(*tag[::RANGE_EVERY].T) + 0.05 * rng.standard_normal(len(ranges))
    ranges["std"] = np.nan
    return SampleBatch(imu=imu, ranges=ranges), tag


def rms_error(lever: tuple[float, float]) -> float:
    batch, tag = carried()
    settings = default_settings()
    settings["mount_angle"], settings["lever_x"], settings["lever_y"] = 0.0, *lever
    settings["start_known"], settings["start_x"], settings["start_y"], settings["start_heading"] = True, 5.0, 0.0, 0.0
    fleet = FleetEngine()
    fleet.set_anchors(np.zeros(1, ANCHOR))
    fleet.configure(0, settings)
    poses = fleet.process(batch).poses
    true = tag[np.round(poses["t_ns"] / (STEP_S * 1e9)).astype(int)]
    return float(np.sqrt(np.mean((poses["x"] - true[:, 0]) ** 2 + (poses["y"] - true[:, 1]) ** 2)))


def test_a_tag_on_an_arm_is_followed_if_its_lever_is_set() -> None:
    with_lever, without, mirrored = (rms_error(lever) for lever in (LEVER, (0.0, 0.0), (-LEVER[0], -LEVER[1])))
    assert with_lever < 1.0
    assert without > 2.0 * with_lever
    assert mirrored > 5.0 * with_lever

"""The bounds with unknown mounting angle, biases, tilt and iron against the inverse of a Fisher matrix.

The matrix comes from finite differences of the simulator's own nonlinear equations over a short motion. Its parameters
are the start, every yaw rate and acceleration, every step of the random processes, and all constant errors.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from dropanchor_evaluation.bounds import vehicle
from dropanchor_evaluation.bounds.linear import WAVE_DAMPING
from dropanchor_evaluation.bounds.vehicle import Knowledge, Motion, raw_model, scalar_model
from dropanchor_evaluation.pcrb import Path
from dropanchor_service.estimation.columns import Array
from dropanchor_tag_client.simulator.imu import GRAVITY, Attitude, into_body, turned, untilted
from dropanchor_tag_client.simulator.sensors import SensorModels, calibrated, preset

DT, N, REST = 0.2, 16, 3
STEP = 1e-5


@dataclass
class Parameters:
    """Values by name, each (k,), and the variances of their priors."""

    values: dict[str, Array]
    variances: dict[str, Array]

    def add(self, name: str, value: ArrayLike, std: ArrayLike) -> None:
        self.values[name] = np.atleast_1d(np.asarray(value, float))
        self.variances[name] = np.broadcast_to(np.asarray(std, float) ** 2, self.values[name].shape)

    def add_waves(self, name: str, std: float, lengths: tuple[float, float], du: Array) -> None:
        """Add start, slope and steps. The standard deviation of the slope is that of the waves, by quadrature."""
        u = np.linspace(math.log(lengths[0]), math.log(lengths[1]), 200_001)
        w = math.sqrt(float(np.mean((2 * math.pi / np.exp(u)) ** 2)))
        self.add(name, [0.0, 0.0], [std, std * w])
        self.add(f"{name} steps", np.zeros(len(du)), np.sqrt(4 * WAVE_DAMPING * w**3 * std**2 * np.maximum(du, 1e-12)))
        self.values[f"{name} rate"] = np.array([w])
        self.variances[f"{name} rate"] = np.array([0.0])


def wave(values: dict[str, Array], name: str, du: Array) -> tuple[Array, Array]:
    """Return value and slope at every instant."""
    w = values[f"{name} rate"][0]
    found = [values[name]]
    for step, kick in zip(du, values[f"{name} steps"], strict=True):
        value, slope = found[-1]
        found.append(
            np.array([value + step * slope, slope - step * (w * w * value + 2 * WAVE_DAMPING * w * slope) + kick])
        )
    value_and_slope = np.array(found).T
    return value_and_slope[0], value_and_slope[1]


def driven(values: dict[str, Array]) -> dict[str, Array]:
    """Return the motion: Euler steps, with the new yaw rate and acceleration."""
    yaw, speed = (values[f"{n}0"][0] + DT * np.r_[0, np.cumsum(values[r][1:])] for n, r in (("yaw", "w"), ("v", "a")))
    course = yaw + values["mount"][0]
    x = values["x0"][0] + DT * np.r_[0, np.cumsum((speed * np.cos(course))[:-1])]
    y = values["y0"][0] + DT * np.r_[0, np.cumsum((speed * np.sin(course))[:-1])]
    return {"x": x, "y": y, "yaw": yaw, "v": speed, "course": course}


def common(known: Knowledge, mount: float) -> Parameters:
    p = Parameters({}, {})
    w, a = (np.r_[np.zeros(REST), rest] for rest in (0.3 * np.ones(N - REST), np.linspace(1.5, -0.5, N - REST)))
    p.add("x0", 10.0, known.start)
    p.add("y0", 2.0, known.start)
    p.add("yaw0", 0.4 - mount, known.yaw)
    p.add("v0", 0.0, known.speed)
    p.add("w", w, vehicle.ANY_YAW_RATE)
    p.add("a", a, vehicle.ANY_ACCELERATION)
    p.add("mount", mount, known.mount)
    return p


def ranges_and_rest(values: dict[str, Array], models: SensorModels) -> list[Array]:
    """Return whitened measurements, one (k,) array each."""
    at = driven(values)
    return [
        np.hypot(at["x"], at["y"])[::2] / models.ranges.std,
        at["v"][:REST] / vehicle.REST_SPEED,
        values["w"][:REST] / vehicle.REST_YAW_RATE,
    ]


def scalars(values: dict[str, Array], models: SensorModels, mount: float) -> Array:
    s, at = models.scalar, driven(values)
    leak = [values["leak"][0]]
    for kick in values["leak steps"]:
        leak.append(leak[-1] * math.exp(-DT / s.leak_tau_s) + kick)
    forward = values["a"] + values["bias"] + np.array(leak)
    acc = turned(forward, at["v"] * values["w"], np.zeros(N), values["mount"][0])[:, :2]
    noise = np.where(np.arange(N) < REST, s.acceleration_std_rest, s.acceleration_std)
    cos, sin = math.cos(mount), math.sin(mount)
    cov = np.array([[cos * cos, sin * cos], [sin * cos, sin * sin + 1]])  # noise along the course, and to the left
    white = acc @ np.linalg.cholesky(np.linalg.inv(cov)) / noise[:, None]
    parts = [at["yaw"] / s.heading_std, (values["w"] + values["gyro bias"]) / s.gyro_std, white.ravel()]
    return np.concatenate([*ranges_and_rest(values, models), *parts])


def raw(values: dict[str, Array], models: SensorModels, magnetometer: bool) -> Array:
    imu, at = models.imu, driven(values)
    du, dt = np.abs(TRUE_SPEED[:-1]) * DT, np.full(N - 1, DT)
    (roll, roll_slope), (pitch, pitch_slope) = (wave(values, f"{axis} rocking", du) for axis in ("roll", "pitch"))
    tilt = Attitude(roll + values["lean"][0], pitch + values["lean"][1], at["yaw"])
    d_roll, d_pitch, d_yaw = roll_slope * np.abs(at["v"]), pitch_slope * np.abs(at["v"]), values["w"]
    gyro = np.column_stack(
        [
            d_roll - d_yaw * np.sin(tilt.pitch),
            d_pitch * np.cos(tilt.roll) + d_yaw * np.cos(tilt.pitch) * np.sin(tilt.roll),
            -d_pitch * np.sin(tilt.roll) + d_yaw * np.cos(tilt.pitch) * np.cos(tilt.roll),
        ]
    )
    gyro = gyro + values["gyro bias"] + wave(values, "wander", dt)[0][:, None] * np.array([0.0, 0.0, 1.0])
    level = turned(values["a"], at["v"] * values["w"], np.full(N, GRAVITY), values["mount"][0])
    acc = untilted(tilt, level) * (1.0 + np.r_[values["scale"], 0.0]) + values["acc bias"]
    moving = np.minimum(np.abs(TRUE_SPEED), 1.0)[:, None]
    parts = [
        *ranges_and_rest(values, models),
        (gyro / np.hypot(imu.gyro_std, imu.vibration_gyro * moving)).ravel(),
        (acc / np.hypot(imu.acc_std, imu.vibration_acc * moving)).ravel(),
    ]
    if magnetometer:
        north, down = imu.field_ut * math.cos(imu.dip_rad), imu.field_ut * math.sin(imu.dip_rad)
        field = into_body(tilt, np.column_stack([np.zeros(N), np.full(N, north), np.full(N, -down)]))
        xx, yy, xy = values["soft"]
        soft = np.array([[1 + xx, xy, 0], [xy, 1 + yy, 0], [0, 0, 1]])
        parts.append(((field @ soft.T + values["hard"]) / imu.mag_std).ravel())
    return np.concatenate(parts)


def add_raw_errors(p: Parameters, models: SensorModels) -> None:
    imu = models.imu
    for axis in ("roll", "pitch"):
        p.add_waves(f"{axis} rocking", imu.rocking_std, imu.rocking_m, np.abs(TRUE_SPEED[:-1]) * DT)
    p.add_waves("wander", imu.gyro_wander_std, (30.0, 300.0), np.full(N - 1, DT))
    p.add("lean", np.zeros(2), imu.lean_std)
    p.add("gyro bias", np.zeros(3), imu.gyro_bias_std)
    p.add("acc bias", np.zeros(3), [*[imu.acc_bias_std] * 2, math.hypot(imu.acc_bias_std, imu.acc_scale_std * GRAVITY)])
    p.add("scale", np.zeros(2), imu.acc_scale_std)
    down, shared = imu.field_ut * math.sin(imu.dip_rad), imu.soft_iron_std / math.sqrt(2)
    p.add("soft", np.zeros(3), [imu.soft_iron_std, imu.soft_iron_std, shared])
    p.add("hard", np.zeros(3), [math.hypot(imu.hard_iron_std, c * down) for c in (shared, shared, imu.soft_iron_std)])


def add_scalar_errors(p: Parameters, models: SensorModels) -> None:
    s = models.scalar
    p.add("gyro bias", 0.0, s.gyro_bias_std)
    p.add("bias", 0.0, s.acceleration_bias_std)
    p.add("leak", 0.0, s.leak_std)
    decay = math.exp(-DT / s.leak_tau_s)
    p.add("leak steps", np.zeros(N - 1), s.leak_std * math.sqrt(1 - decay**2))


def by_brute_force(p: Parameters, measured: Callable[[dict[str, Array]], Array]) -> float:
    """Return E[(x - x̂)² + (y - ŷ)²] at the end from the inverse of the information of all parameters."""
    free = [(name, i) for name, var in p.variances.items() for i in range(len(var)) if var[i] > 0]
    rows, places = [], []
    for name, i in free:
        ends = []
        for sign in (1, -1):
            shifted = {**p.values, name: p.values[name].copy()}
            shifted[name][i] += sign * STEP
            at = driven(shifted)
            ends.append((measured(shifted), np.array([at["x"][-1], at["y"][-1]])))
        rows.append((ends[0][0] - ends[1][0]) / (2 * STEP))
        places.append((ends[0][1] - ends[1][1]) / (2 * STEP))
    std = np.sqrt([p.variances[name][i] for name, i in free])
    H, G = np.array(rows) * std[:, None], np.array(places) * std[:, None]
    covariance = np.linalg.inv(np.eye(len(free)) + H @ H.T)
    return float(np.trace(G.T @ covariance @ G))


def motion(mount: float) -> Motion:
    p = common(Knowledge(), mount)
    at = driven(p.values)
    path = Path(DT * np.arange(N), at["x"], at["y"], at["course"], at["v"], np.arange(N) % 2 == 0)
    # `level` takes backward differences of the speed, which are the accelerations here.
    return Motion(path, p.values["w"], mount)


TRUE_SPEED = motion(0.0).path.v
REAL = calibrated(preset("real"))
KNOWN = Knowledge(mount=0.5, yaw=0.05)
UNKNOWN = Knowledge(start=30.0, yaw=vehicle.ANY_ANGLE, speed=3.0, mount=vehicle.ANY_ANGLE)


@pytest.mark.parametrize("known", [KNOWN, UNKNOWN, Knowledge()])
@pytest.mark.parametrize("mount", [0.0, 0.7])
def test_the_bound_of_scalars_is_the_inverse_information_of_the_simulators_equations(
    known: Knowledge, mount: float
) -> None:
    p = common(known, mount)
    add_scalar_errors(p, REAL)
    expected = by_brute_force(p, lambda values: scalars(values, REAL, mount))
    bound = scalar_model(motion(mount), REAL, known).bound(1, 0).position[-1]
    assert bound == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(("known", "magnetometer"), [(KNOWN, True), (UNKNOWN, True), (Knowledge(), False)])
@pytest.mark.parametrize("mount", [0.0, 0.7])
def test_the_bound_of_raw_samples_is_the_inverse_information_of_the_simulators_equations(
    known: Knowledge, magnetometer: bool, mount: float
) -> None:
    # The errors of the scales are those of the body's axes: only without them the body may be turned.
    models = REAL if mount == 0.0 else replace(REAL, imu=replace(REAL.imu, acc_scale_std=0.0))
    p = common(known, mount)
    add_raw_errors(p, models)
    expected = by_brute_force(p, lambda values: raw(values, models, magnetometer))
    bound = raw_model(motion(mount), models, known, magnetometer).bound(1, 0).position[-1]
    assert bound == pytest.approx(expected, rel=1e-4)

"""Drives with a level IMU and a platform's heading, made without the simulator of the tag client.

Legs of constant speed with turns or arcs between them. Each axis has white noise of its own, quiet at rest; the forward
accelerometer also has a bias that wanders for seconds. One anchor at the origin.
"""

import math

import numpy as np

from dropanchor_evaluation.product.runs import TagRun
from dropanchor_service.estimation.columns import (
    ANCHOR,
    HEADING,
    IMU,
    RANGE,
    HeadingSource,
    SampleBatch,
    default_settings,
)
from dropanchor_service.offline.accuracy import Truth

HZ = 100
LEGS = {"C5": (0.2, 1.2, 10.0, 20.0, 0.35), "M5": (0.5, 4.0, 8.0, 14.0, 0.5)}  # m/s, s, rad/s


def _motion(kind: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return speed, m/s, and yaw rate, rad/s, of every sample, from a second of rest on."""
    slow, fast, short, long, bend = LEGS[kind]
    speeds, rates, before = [np.zeros(HZ)], [np.zeros(HZ)], 0.0
    for leg in range(5):
        n, speed = int(HZ * rng.uniform(short, long)), rng.uniform(slow, fast)
        ramp = np.minimum(np.arange(n) / (0.5 * HZ), 1.0)
        speeds.append(before + (speed - before) * 0.5 * (1.0 - np.cos(math.pi * ramp)))
        sign, arc = rng.choice([-1.0, 1.0]), rng.random() < 0.5
        turned = sign * rng.uniform(0.3, 2.2) * 2.0 * (1.0 - np.cos(2.0 * math.pi * ramp)) * (leg > 0)
        rates.append(ramp * sign * rng.uniform(0.05, bend) if arc else turned)
        before = speed
    return np.concatenate(speeds), np.concatenate(rates)


def level_scalars(kind: str, seed: int, range_hz: int) -> TagRun:
    """Return one tag of which nothing is told but its start."""
    rng = np.random.default_rng([seed, 77])
    far = near = math.nan
    while not (near > 0.7 and far < 120.0):
        speed, rate = _motion(kind, rng)
        yaw = rng.uniform(-math.pi, math.pi) + np.cumsum(rate) / HZ
        x, y = 10.0 + np.cumsum(speed * np.cos(yaw)) / HZ, np.cumsum(speed * np.sin(yaw)) / HZ
        distance = np.hypot(x, y)
        near, far = distance.min(), distance.max()
    n, every = len(speed), HZ // range_hz
    t_ns = np.arange(n) * 10_000_000
    kept, slow = math.exp(-1.0 / HZ / 5.0), np.zeros(n)
    for i in range(1, n):
        slow[i] = kept * slow[i - 1] + rng.normal(0.0, 0.04 * math.sqrt(1.0 - kept * kept))
    imu, headings, ranges = np.zeros(n, IMU), np.zeros(n, HEADING), np.zeros(len(t_ns[::every]), RANGE)
    imu["t_ns"], headings["t_ns"], ranges["t_ns"], imu["mag"] = t_ns, t_ns, t_ns[::every], np.nan
    imu["acc"] = np.where(speed > 0.02, 0.1, 0.025)[:, None] * rng.standard_normal((n, 3)) + [0.0, 0.0, 9.80665]
    imu["acc"][:, 0] += np.gradient(speed) * HZ + rng.normal(0.0, 0.05) + slow
    imu["acc"][:, 1] += speed * rate
    imu["gyro"] = 0.02 * rng.standard_normal((n, 3))
    imu["gyro"][:, 2] += rate + rng.normal(0.0, 0.01)
    headings["heading"], headings["std"] = yaw + 0.1 * rng.standard_normal(n), 0.1
    ranges["range"], ranges["std"] = distance[::every] + 0.2 * rng.standard_normal(len(ranges)), 0.2
    settings = default_settings()
    settings["height"], settings["heading_source"], settings["start_known"] = 0.0, HeadingSource.PLATFORM, True
    settings["start_x"], settings["start_y"], settings["start_heading"] = x[0], y[0], yaw[0]
    truth = Truth(t_ns * 1e-9, x, y)
    return TagRun(f"{kind} {seed}", SampleBatch(imu, ranges, headings), settings, truth, np.zeros(1, ANCHOR), False)

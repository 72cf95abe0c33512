"""A tag on straight legs around an anchor at the origin, with the samples of its sensors, for tests of engines."""

import math
from dataclasses import dataclass

import numpy as np

from dropanchor_service.estimation.columns import HEADING, IMU, RANGE, Array, SampleBatch, default_settings

GRAVITY = 9.80665
T0_NS = 1_760_000_000_000_000_000


@dataclass(frozen=True)
class Track:
    """The truth at the times t, s: arrays of one length, in m, rad, m/s and rad/s."""

    t: Array
    x: Array
    y: Array
    heading: Array
    speed: Array
    yaw_rate: Array

    def at(self, t: Array) -> tuple[Array, Array]:
        """Return x and y at the times t, s."""
        return np.interp(t, self.t, self.x), np.interp(t, self.t, self.y)


def straight_legs(seed: int, legs: int = 5, dt: float = 0.01) -> Track:
    """Return a track from (10, 0): rest, then legs of 8 to 14 s at 0.5 to 4 m/s with half-second turns between them."""
    rng = np.random.default_rng(seed)
    speed, turn = [np.zeros(100)], [np.zeros(100)]
    v = 0.0
    for leg in range(legs):
        new, length, ramp = rng.uniform(0.5, 4.0), int(rng.uniform(8.0, 14.0) / dt), int(0.5 / dt)
        angle = 0.0 if leg == 0 else rng.choice([-1, 1]) * rng.uniform(0.3, 2.2)
        phase = (np.arange(ramp) + 0.5) / ramp * math.pi
        speed += [v + (new - v) * (1 - np.cos(phase)) / 2, np.full(length, new)]
        turn += [angle * np.sin(phase) / np.sin(phase).sum() / dt, np.zeros(length)]
        v = new
    s, w = np.concatenate(speed), np.concatenate(turn)
    heading = rng.uniform(-math.pi, math.pi) + np.cumsum(w) * dt
    x, y = 10 + np.cumsum(s * np.cos(heading)) * dt, np.cumsum(s * np.sin(heading)) * dt
    return Track(np.arange(len(s)) * dt, x, y, heading, s, w)


def settings_at_start(track: Track) -> Array:
    """Return TAG_SETTINGS of a tag whose start is known."""
    settings = default_settings()
    settings["start_known"] = True
    settings["start_x"], settings["start_y"], settings["start_std"] = track.x[0], track.y[0], 0.1
    return settings


def _times(columns: Array, t: Array) -> Array:
    columns["t_ns"] = T0_NS + np.round(t * 1e9).astype(np.int64)
    return columns


def range_samples(track: Track, rng: np.random.Generator, every: int = 10, std: float = 0.1) -> Array:
    """Return RANGE at every nth step of the track, with white noise."""
    at = slice(0, None, every)
    samples = _times(np.zeros(len(track.t[at]), RANGE), track.t[at])
    samples["range"] = np.hypot(track.x, track.y)[at] + rng.normal(0, std, len(samples))
    samples["std"] = np.nan
    return samples


def heading_samples(track: Track, rng: np.random.Generator, every: int = 1, std: float = 0.05) -> Array:
    """Return HEADING of a platform, with white noise."""
    at = slice(0, None, every)
    samples = _times(np.zeros(len(track.t[at]), HEADING), track.t[at])
    samples["heading"] = (
        np.remainder(track.heading[at] + rng.normal(0, std, len(samples)) + math.pi, math.tau) - math.pi
    )
    samples["std"] = std
    return samples


def imu_samples(track: Track, rng: np.random.Generator, magnetometer: bool = True) -> Array:
    """Return IMU of a level body that points along its course. The field is 20 µT north and 44 µT down."""
    n = len(track.t)
    samples = _times(np.zeros(n, IMU), track.t)
    samples["acc"][:, 0] = np.gradient(track.speed, track.t)
    samples["acc"][:, 1] = track.speed * track.yaw_rate
    samples["acc"][:, 2] = GRAVITY
    samples["acc"] += rng.normal(0, 0.05, (n, 3))
    samples["gyro"][:, 2] = track.yaw_rate
    samples["gyro"] += rng.normal(0, 0.01, (n, 3))
    samples["mag"] = np.stack([20 * np.sin(track.heading), 20 * np.cos(track.heading), np.full(n, -44.0)], axis=1)
    samples["mag"] += rng.normal(0, 0.5, (n, 3)) if magnetometer else np.nan
    return samples


def samples_of(track: Track, seed: int, imu: bool = True) -> SampleBatch:
    """Return 10 Hz ranges with 0.1 m of noise, and an IMU or a platform's headings at the rate of the track."""
    rng = np.random.default_rng(seed)
    ranges = range_samples(track, rng)
    if imu:
        return SampleBatch(imu=imu_samples(track, rng), ranges=ranges)
    return SampleBatch(headings=heading_samples(track, rng), ranges=ranges)

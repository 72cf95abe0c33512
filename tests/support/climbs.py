"""Simulated tags whose height changes: the same runs as on level ground, seen from elsewhere, and a barometer.

A run keeps its horizontal motion, its IMU and the noise of its ranges. Its ranges get the distances of the new height.
The barometer has white noise, the weather is a random walk, and the air is not that of the standard atmosphere.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from dropanchor_evaluation.product.runs import TagRun
from dropanchor_service.estimation.columns import PRESSURE, Array, SampleBatch
from dropanchor_service.offline.accuracy import truth_at
from dropanchor_service.offline.replay import NS_PER_S, Track

GAS = 8.314462618 / (9.80665 * 0.0289644)  # m/K, the constant of the hypsometric equation
CLIMB = 23  # random stream of `climbing`

Height = Callable[[Array], Array]
"""Takes times, s, and returns heights above that at the start, m."""


def step(height: float, at_s: float = 40.0) -> Height:
    """Return a height that changes at once, as nothing does."""
    return lambda t: np.where(t >= at_s, height, 0.0)


def ramp(height: float, speed: float, at_s: float = 20.0) -> Height:
    """Return a height that changes at this speed, m/s, as in a lift."""
    return lambda t: np.clip((t - at_s) * speed, 0.0, height)


def sine(amplitude: float, period_s: float = 60.0) -> Height:
    return lambda t: amplitude * np.sin(2.0 * math.pi * t / period_s)


def drone(t: Array) -> Array:
    """Return the flight of a drone: up to 10 m, down to 4 m, up again and down to the ground."""
    return np.interp(t, [5.0, 10.0, 18.0, 24.0, 30.0, 40.0], [0.0, 10.0, 10.0, 4.0, 10.0, 0.0])


def stairs(t: Array) -> Array:
    """Return two floors of stairs: 40 steps of 0.17 m in 0.55 s each."""
    return 0.17 * np.floor(np.clip((t - 10.0) / 0.55, 0.0, 40.0))


CLIMBS: Mapping[str, Height] = {
    "flat": lambda t: np.zeros_like(t),
    "step 3 m": step(3.0),
    "step 5 m": step(5.0),
    "step 10 m": step(10.0),
    "lift 10 m": ramp(10.0, 1.5),
    "sine 10 m": sine(10.0),
    "drone": drone,
    "stairs": stairs,
}


@dataclass(frozen=True)
class Barometer:
    """noise_std: of one pressure, m. drift: of the weather, m after 30 s. air_std: of the air's temperature, K."""

    hz: float = 10.0
    noise_std: float = 0.15
    drift: float = 0.15
    air_std: float = 8.0


def climbing(run: TagRun, height: Height, barometer: Barometer | None, seed: int) -> tuple[TagRun, Height]:
    """Return the run at another height, and that height. Without a barometer it sends no pressures."""
    rng = np.random.default_rng([seed, CLIMB])
    told = float(run.settings["height"]) + 0.15 * rng.standard_normal()
    ranges, z = run.samples.ranges.copy(), float(run.settings["height"])
    t = ranges["t_ns"] / NS_PER_S
    x, y, *_ = truth_at(run.truth, t)
    anchor = run.anchors[ranges["anchor"]]
    level = (x - anchor["x"]) ** 2 + (y - anchor["y"]) ** 2
    before, now = z - anchor["z"], z + height(t) - anchor["z"]
    ranges["range"] += np.nan_to_num(np.sqrt(level + now**2) - np.sqrt(level + before**2))
    ranges["range"] = np.maximum(ranges["range"], 0.0)
    settings = run.settings.copy()
    settings["height"] = told
    pressures = np.empty(0, PRESSURE) if barometer is None else _pressures(t[-1], height, barometer, rng)
    samples = SampleBatch(run.samples.imu, ranges, run.samples.headings, pressures=pressures)
    return replace(run, samples=samples, settings=settings), lambda t: z + height(t)


def _pressures(until_s: float, height: Height, barometer: Barometer, rng: np.random.Generator) -> Array:
    t = np.arange(0.0, until_s, 1.0 / barometer.hz)
    weather = np.cumsum(rng.standard_normal(len(t))) * barometer.drift / math.sqrt(30.0 * barometer.hz)
    shown = height(t) + weather + barometer.noise_std * rng.standard_normal(len(t))
    air = 288.15 + barometer.air_std * rng.standard_normal()
    pressures = np.zeros(len(t), PRESSURE)
    pressures["t_ns"], pressures["temperature"] = np.rint(t * NS_PER_S), np.nan
    pressures["pressure"] = rng.uniform(95_000.0, 104_000.0) * np.exp(-shown / (GAS * air))
    return pressures


@dataclass(frozen=True)
class HeightScore:
    """Of the heights of poses: RMSE, m, the share within 1.96 standard deviations, the largest error in them."""

    rmse: float
    coverage: float
    worst_sigma: float


def height_score(track: Track, height: Height) -> HeightScore:
    """Compare the heights of a track with the true ones."""
    error, std = track.poses["z"] - height(track.t), track.poses["z_std"]
    known = np.isfinite(error)
    error, sigmas = error[known], np.abs(error[known] / std[known])
    return HeightScore(
        rmse=float(np.sqrt(np.mean(error**2))), coverage=float(np.mean(sigmas < 1.96)), worst_sigma=float(sigmas.max())
    )

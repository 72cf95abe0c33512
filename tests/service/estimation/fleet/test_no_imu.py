"""Tags without an IMU: one that circles its anchor does not stand."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from dropanchor_service.estimation.columns import (
    ANCHOR,
    HEADING,
    RANGE,
    Array,
    HeadingSource,
    SampleBatch,
    State,
    default_settings,
)
from dropanchor_service.estimation.columns import Frame as PoseFrame
from dropanchor_service.estimation.fleet.engine import FleetEngine

T0_NS, PERIOD_S, NOISE_M = 1_000_000_000, 0.05, 0.1
AT_ORIGIN = [(0.0, 0.0, 0.0)]


class Path(NamedTuple):
    """Where a tag is, m, and which way it goes, rad, every PERIOD_S."""

    t_s: Array
    x: Array
    y: Array
    course: Array


class Run(NamedTuple):
    """Poses in order of time, POSE (n,), and the errors of their places, m."""

    poses: Array
    errors: Array

    @property
    def is_tracking(self) -> Array:
        tracking: Array = (self.poses["state"] == State.TRACKING) & (self.poses["frame"] == PoseFrame.SITE)
        return tracking

    def worst_sigma(self) -> float:
        off, cov = self.errors[self.is_tracking], self.poses["cov"][self.is_tracking][:, :2, :2]
        squared = np.einsum("ij,ij->i", off, np.linalg.solve(cov, off[..., None])[..., 0])
        return math.sqrt(float(squared.max(initial=0.0)))


def path_of(x: Array, y: Array) -> Path:
    return Path(PERIOD_S * np.arange(len(x)), x, y, np.arctan2(np.gradient(y), np.gradient(x)))


def circle(seed: int, seconds: float = 60.0) -> Path:
    """Return a circle of 3 m about the origin at 0.45 m/s."""
    angle = np.random.default_rng(seed).uniform(0.0, math.tau) + 0.15 * PERIOD_S * np.arange(seconds / PERIOD_S)
    return path_of(3.0 * np.cos(angle), 3.0 * np.sin(angle))


def ranges(path: Path, anchors: list[tuple[float, float, float]], hz: float, seed: int) -> Array:
    """Return ranges to all anchors at once, with white noise."""
    rng = np.random.default_rng([seed, 1])
    t = np.arange(0.0, path.t_s[-1] - 0.5, 1.0 / hz)
    found = np.zeros((len(t), len(anchors)), RANGE)
    x, y = np.interp(t, path.t_s, path.x), np.interp(t, path.t_s, path.y)
    for k, (ax, ay, az) in enumerate(anchors):
        found["anchor"][:, k], found["t_ns"][:, k] = k, T0_NS + np.rint(1e9 * t)
        found["range"][:, k] = np.sqrt((x - ax) ** 2 + (y - ay) ** 2 + az**2) + NOISE_M * rng.standard_normal(len(t))
    found["std"] = np.nan
    flat: Array = found.ravel()
    return flat


def headings(path: Path, seed: int) -> Array:
    found = np.zeros(len(path.t_s), HEADING)
    found["t_ns"], found["std"] = T0_NS + np.rint(1e9 * path.t_s), np.nan
    found["heading"] = path.course + 0.01 * np.random.default_rng([seed, 2]).standard_normal(len(path.t_s))
    return found


def run(path: Path, anchors: list[tuple[float, float, float]], samples: SampleBatch, start: bool = False) -> Run:
    engine, settings = FleetEngine(), default_settings()
    engine.set_anchors(np.array(anchors, ANCHOR))
    if len(samples.headings):
        settings["heading_source"] = HeadingSource.PLATFORM
    if start:
        settings["start_known"], settings["start_x"], settings["start_y"] = True, path.x[0], path.y[0]
    engine.configure(0, settings)
    poses = engine.process(samples).poses
    t_s = (poses["t_ns"] - T0_NS) * 1e-9
    places = np.stack([np.interp(t_s, path.t_s, path.x), np.interp(t_s, path.t_s, path.y)], axis=1)
    return Run(poses, np.stack([poses["x"], poses["y"]], axis=1) - places)


@pytest.mark.parametrize("seed", [61_800, 61_801])
@pytest.mark.parametrize("hz", [1.0, 2.0, 5.0, 10.0])
def test_a_tag_that_circles_its_anchor_is_not_surely_where_it_started(hz: float, seed: int) -> None:
    """Its ranges are those of a tag that turns on the spot. Only its course tells the two apart."""
    path = circle(seed)
    samples = SampleBatch(ranges=ranges(path, AT_ORIGIN, hz, seed), headings=headings(path, seed))
    told = run(path, AT_ORIGIN, samples, start=True)
    assert told.is_tracking[0]
    assert told.worst_sigma() < 3.0  # 26 to 36 before

"""Tags without an IMU: one that circles its anchor does not stand, and ranges to three anchors are a place."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from dropanchor_service.estimation.columns import (
    HEADING,
    IMU,
    RANGE,
    Array,
    HeadingSource,
    SampleBatch,
    State,
    anchors_at,
    default_settings,
)
from dropanchor_service.estimation.columns import Frame as PoseFrame
from dropanchor_service.estimation.fleet.engine import FleetEngine

T0_NS, PERIOD_S, NOISE_M = 1_000_000_000, 0.05, 0.1
CORNERS = [(0.0, 0.0, 2.0), (12.0, 0.0, 2.0), (0.0, 9.0, 2.0)]
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


def hall(seed: int, seconds: float = 40.0) -> Path:
    """Return a way of a walker in the hall between the anchors."""
    begin = np.random.default_rng(seed).uniform(0.0, math.tau, 2)
    t = PERIOD_S * np.arange(seconds / PERIOD_S)
    return path_of(6.0 + 4.0 * np.sin(0.3 * t + begin[0]), 4.5 + 3.0 * np.sin(0.4 * t + begin[1]))


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
    engine.set_anchors(anchors_at(*anchors))
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


@pytest.mark.parametrize("seed", [61_810, 61_811])
@pytest.mark.parametrize("hz", [1.0, 2.0, 10.0])
def test_ranges_to_three_anchors_are_a_place_without_any_heading(hz: float, seed: int) -> None:
    path = hall(seed)
    found = run(path, CORNERS, SampleBatch(ranges=ranges(path, CORNERS, hz, seed)))
    assert found.is_tracking[2]  # with the third range
    assert found.is_tracking.mean() > 0.9
    assert np.median(np.hypot(*found.errors[found.is_tracking].T)) < 0.6
    assert found.worst_sigma() < 5.0


@pytest.mark.parametrize("anchors", [CORNERS[:1], CORNERS[:2], [*CORNERS[:2], (6.0, 0.1, 2.0)]], ids=["1", "2", "line"])
def test_fewer_anchors_or_anchors_in_a_line_are_none(anchors: list[tuple[float, float, float]]) -> None:
    path = hall(61_820)
    found = run(path, anchors, SampleBatch(ranges=ranges(path, anchors, 10.0, 61_820)))
    assert set(found.poses["state"]) == {State.INITIALISING}


@pytest.mark.parametrize("seed", range(61_821, 61_825))
def test_ranges_of_an_anchor_that_contradict_the_others_are_hardly_ever_a_place(seed: int) -> None:
    """Three ranges agree by chance at some places."""
    path = hall(seed)
    found = ranges(path, CORNERS, 10.0, seed)
    found["range"][found["anchor"] == 1] += 4.0
    assert run(path, CORNERS, SampleBatch(ranges=found)).is_tracking.mean() < 0.1


def test_one_range_that_is_far_too_long_moves_no_track_and_a_wrong_track_ends() -> None:
    path = hall(61_822)
    found = ranges(path, CORNERS, 2.0, 61_822)
    rng = np.random.default_rng(61_822)
    found["range"] += rng.exponential(1.0, len(found)) * (rng.random(len(found)) < 0.1)
    assert np.percentile(np.hypot(*run(path, CORNERS, SampleBatch(ranges=found)).errors[5:].T), 95) < 2.0


def test_a_tag_with_an_imu_starts_there_too_and_one_that_gets_it_later_goes_on() -> None:
    path = hall(61_823)
    imu = np.zeros(100 * 39, IMU)
    imu["t_ns"] = T0_NS + 10_000_000 * np.arange(len(imu))
    course = np.interp(0.01 * np.arange(len(imu)), path.t_s, np.unwrap(path.course))
    speed = np.interp(
        0.01 * np.arange(len(imu)), path.t_s, np.hypot(np.gradient(path.x), np.gradient(path.y)) / PERIOD_S
    )
    rate = np.gradient(course) * 100.0
    noise = np.random.default_rng(61_823).standard_normal((len(imu), 3))
    imu["acc"] = np.stack([np.gradient(speed) * 100.0, speed * rate, np.full(len(imu), 9.81)], axis=1) + 0.1 * noise
    imu["gyro"] = np.stack([0.0 * rate, 0.0 * rate, rate], axis=1) + 0.01 * noise
    imu["mag"] = np.nan
    for later in (imu, imu[1500:]):
        found = run(path, CORNERS, SampleBatch(imu=later, ranges=ranges(path, CORNERS, 10.0, 61_823)))
        assert found.is_tracking.mean() > 0.8
        assert np.median(np.hypot(*found.errors[found.is_tracking].T)) < 0.5

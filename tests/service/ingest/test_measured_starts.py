"""A range and an azimuth tell where a tag starts, through the real ingest and engine, whatever errors last."""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from dropanchor_schemas.wire import BearingSample, Frame, RangeSample
from dropanchor_service.estimation.columns import POSE, Array, State, StateReason
from dropanchor_service.estimation.columns import Frame as PoseFrame
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_tag_client.simulator.azimuth import AzimuthModel
from dropanchor_tag_client.simulator.live import REST_BEFORE_S, deliveries
from dropanchor_tag_client.simulator.scenarios import trajectory
from dropanchor_tag_client.simulator.sensors import preset
from support.ingest import IngestBench
from support.traffic import T0_NS

FACING = 0.5
FIVE = math.radians(5.0)
AWAY = AzimuthModel(FIVE, facing=FACING)


class Run(NamedTuple):
    """Poses in order of time, POSE (n,), s since the start, the errors of their places, and true distances, m."""

    poses: Array
    t_s: Array
    errors: Array
    distance: Array

    @property
    def is_tracking(self) -> Array:
        tracking: Array = (self.poses["state"] == State.TRACKING) & (self.poses["frame"] == PoseFrame.SITE)
        return tracking

    @property
    def share(self) -> Array:
        """Errors as shares of the distance."""
        shares: Array = np.hypot(self.errors[:, 0], self.errors[:, 1]) / self.distance
        return shares

    def beyond(self, sigmas: float) -> int:
        """Return how many poses that are tracking are further off than that."""
        off, cov = self.errors[self.is_tracking], self.poses["cov"][self.is_tracking][:, :2, :2]
        squared = np.einsum("ij,ij->i", off, np.linalg.solve(cov, off[..., None])[..., 0])
        return int((squared > sigmas**2).sum())


def bench_of(facing: float | None, mirrors: bool = False, **options: Any) -> IngestBench:
    anchor = {"id": "1", "facing_rad": facing, "mirrors_behind": mirrors}
    return IngestBench(site={"id": "default", "anchors": [anchor]}, **options)


def run_of(scenario: str, seed: int, azimuths: AzimuthModel, seconds: float, mirrors: bool = False) -> Run:
    """Return the poses of a simulated tag of which nothing is told, after each message of 0.2 s."""
    bench, poses = bench_of(azimuths.facing, mirrors, engine=FleetEngine()), []
    models = replace(preset("calibrated", range_hz=10.0, imu_hz=100.0), azimuth=azimuths)
    for part in deliveries(1, scenario, seed, models, T0_NS, step_s=0.2):
        if part.due_s > seconds:
            break
        bench.put("a", Frame(part.imu, part.ranges, bearings=part.bearings), at_ns=T0_NS + round(part.due_s * 1e9))
        bench.ingest.turn()
        if (pose := bench.latest.row(bench.tags.register("a").row)) is not None:
            poses.append(pose.copy())
    motion, found = trajectory(scenario, seed), np.array(poses, POSE)
    motion = motion.after_rest(REST_BEFORE_S) if motion.v[0] == 0.0 else motion
    t_s = (found["t_ns"] - T0_NS) * 1e-9
    there = motion.at(t_s)
    errors = np.stack([found["x"] - there.x, found["y"] - there.y], axis=1)
    return Run(found, t_s, errors, np.hypot(there.x, there.y))


@pytest.mark.parametrize("seed", [48_700, 48_701])
@pytest.mark.parametrize("scenario", ["M5", "OU", "forklift"])
def test_a_tag_of_which_nothing_is_told_is_where_range_and_azimuth_say_within_seconds(scenario: str, seed: int) -> None:
    run = run_of(scenario, seed, AWAY, 20.0)
    assert run.t_s[run.is_tracking][0] < 3.0
    assert run.share[run.is_tracking & (run.t_s < 3.0)].max() < 0.1
    assert np.median(run.share[run.is_tracking]) < 0.1
    assert run.beyond(5.0) == 0


@pytest.mark.parametrize("seed", range(48_710, 48_714))
@pytest.mark.parametrize("scenario", ["M5", "OU", "forklift"])
@pytest.mark.parametrize("facing", [FACING, FACING + math.pi], ids=["ahead", "behind"])
def test_a_tag_that_may_be_behind_two_antennas_is_ambiguous_until_its_motion_tells(
    facing: float, scenario: str, seed: int
) -> None:
    run = run_of(scenario, seed, AzimuthModel(FIVE, facing=facing, is_folded=True), 40.0, mirrors=True)
    begun = run.poses["state"] != State.INITIALISING
    first = run.poses[begun & (run.t_s < 3.0)]
    assert set(first["state"]) == {State.AMBIGUOUS}
    assert StateReason.FRONT_OR_BACK in first["reason"]
    assert run.beyond(5.0) == 0


def test_the_motion_of_most_tags_tells_within_a_minute_on_which_side_of_two_antennas_they_are() -> None:
    runs = [run_of("OU", seed, AzimuthModel(FIVE, facing=math.pi, is_folded=True), 60.0, True) for seed in range(4)]
    assert sum(bool(run.is_tracking[-1]) for run in runs) >= 3


@pytest.mark.parametrize("lasting", [5.0, 10.0])
@pytest.mark.parametrize("scenario", ["M5", "OU"])
def test_errors_that_last_do_not_average_out(scenario: str, lasting: float) -> None:
    """The azimuths tell a standard deviation of 5°, and the anchor is mounted askew by once or twice that."""
    run = run_of(scenario, 48_702, replace(AWAY, facing=FACING + math.radians(lasting)), 60.0)
    assert run.is_tracking.sum() > 100
    assert run.beyond(5.0) == 0


def message(begin: int, azimuths: list[float], std_rad: float = FIVE) -> Frame:
    """Return ranges of 10 m and these azimuths, every 0.1 s. begin: number of the first one."""
    times = [T0_NS + (begin + i) * 100_000_000 for i in range(len(azimuths))]
    return Frame(
        ranges=[RangeSample(t_ns, 1, 10.0) for t_ns in times],
        bearings=[BearingSample(t_ns, 1, one, std_rad) for t_ns, one in zip(times, azimuths, strict=True)],
    )


def starts_of(bench: IngestBench, *messages: Frame, name: str = "start") -> list[tuple[float, float]]:
    """Return the known starts with which the row of the tag was configured, when these messages have come."""
    for one in messages:
        bench.put("a", one, at_ns=one.ranges[-1].t_ns)
        bench.ingest.turn()
    configured = bench.engine.configured[0]
    return [(float(one[f"{name}_x"]), float(one[f"{name}_y"])) for one in configured if one["start_known"]]


AHEAD = [0.0] * 8


def test_the_start_is_where_the_anchor_faces_and_is_as_unsure_as_one_azimuth() -> None:
    bench = bench_of(math.pi / 2, tags={"a": {"height_m": 6.0}})
    (start,) = starts_of(bench, message(0, AHEAD), message(8, AHEAD))
    assert start == pytest.approx((0.0, 8.0), abs=1e-6)  # of 10 m, 6 m are height
    assert bench.engine.configured[0][-1]["start_std"] == pytest.approx(10.0 * FIVE)
    fused = bench.engine.batches[-1].bearings
    assert fused["bearing"] == pytest.approx(math.pi / 2)
    assert (fused["std"] > 10.0 * FIVE).all()


@pytest.mark.parametrize(
    ("azimuth", "place"), [(0.0, (0.0, -10.0)), (0.3, (-10.0 * math.sin(0.3), -10.0 * math.cos(0.3)))]
)
def test_an_anchor_that_mirrors_tells_the_place_behind_it_as_well(azimuth: float, place: tuple[float, float]) -> None:
    (other,) = starts_of(bench_of(math.pi / 2, mirrors=True), message(0, [azimuth] * 8), name="start_other")
    assert other == pytest.approx(place, abs=1e-6)


def test_azimuths_that_do_not_say_how_sure_they_are_last_too() -> None:
    bench = bench_of(0.0)
    starts_of(bench, message(0, AHEAD, math.nan))
    assert (bench.engine.batches[-1].bearings["std"] > 10.0 * FIVE).all()


@pytest.mark.parametrize(
    ("facing", "azimuths", "tag"),
    [
        pytest.param(None, AHEAD, {}, id="an anchor of which nobody said where it faces"),
        pytest.param(0.0, [0.0, 1.0] * 4, {}, id="azimuths that contradict each other"),
        pytest.param(0.0, AHEAD[:4], {}, id="too few azimuths"),
    ],
)
def test_there_is_no_start_from(facing: float | None, azimuths: list[float], tag: dict[str, Any]) -> None:
    bench = bench_of(facing, tags={"a": tag})
    assert starts_of(bench, message(0, azimuths)) == []
    assert bench.engine.batches[-1].bearings["bearing"].tolist() == pytest.approx(azimuths)


def test_a_start_that_is_told_counts_more() -> None:
    bench = bench_of(0.0, tags={"a": {"start": {"x": 3.0, "y": 4.0}}})
    assert starts_of(bench, message(0, AHEAD)) == [(3.0, 4.0)]


def test_a_turned_anchor_starts_its_tags_again() -> None:
    bench = bench_of(0.0)
    assert starts_of(bench, message(0, AHEAD)) == [pytest.approx((10.0, 0.0))]
    (anchor,) = bench.site.site.anchors
    bench.site.set_anchor(anchor.model_copy(update={"facing_rad": math.pi}))
    assert starts_of(bench, message(8, AHEAD))[-1] == pytest.approx((-10.0, 0.0), abs=1e-6)

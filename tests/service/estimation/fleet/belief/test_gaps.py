"""A tag whose samples arrive with gaps: its hypotheses and the honesty of its poses."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import ANCHOR, IMU, POSE, RANGE, SampleBatch, State, default_settings
from dropanchor_service.estimation.fleet.belief.gap import RESTART_SPREAD, RESUME_ANYWHERE_AFTER
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.tuning import Tuning
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate

MESSAGE_NS = 200_000_000
FIRST = 40  # messages from the start that all arrive
SEEDS = range(7100, 7106)

Arrives = Callable[[Any], Any]  # of the messages with these numbers


@pytest.fixture(scope="module")
def runs() -> list[Simulation]:
    return [simulate("M5", seed, preset("calibrated", imu_hz=100.0)) for seed in SEEDS]


def engine_of(runs: list[Simulation]) -> FleetEngine:
    engine = FleetEngine()
    engine.set_anchors(np.zeros(1, ANCHOR))
    for row, run in enumerate(runs):
        settings = default_settings()
        settings["start_known"], settings["start_std"] = True, 0.1
        settings["start_x"], settings["start_y"] = run.truth.x[0], run.truth.y[0]
        settings["start_heading"] = run.truth.heading[0]
        engine.configure(row, settings)
    return engine


def samples_of(runs: list[Simulation], arrives: Arrives) -> SampleBatch:
    """Return the samples of all runs that arrive, for each run in order of time."""
    imu: list[Any] = []
    ranges: list[Any] = []
    for row, run in enumerate(runs):
        inertial, measured = np.zeros(len(run.imu.t_s), IMU), np.zeros(len(run.ranges.t_s), RANGE)
        inertial["acc"], inertial["gyro"], inertial["mag"] = run.imu.acc, run.imu.gyro, run.imu.mag
        measured["range"], measured["std"] = run.ranges.range_m, run.ranges.std_m
        for column, t_s, of_all in ((inertial, run.imu.t_s, imu), (measured, run.ranges.t_s, ranges)):
            column["row"], column["t_ns"] = row, np.rint(t_s * 1e9)
            number = column["t_ns"] // MESSAGE_NS
            of_all.append(column[(number < FIRST) | arrives(number)])
    return SampleBatch(imu=np.concatenate(imu), ranges=np.concatenate(ranges))


def in_messages(samples: SampleBatch) -> list[SampleBatch]:
    numbers = [column["t_ns"] // MESSAGE_NS for column in (samples.imu, samples.ranges)]
    return [
        SampleBatch(imu=samples.imu[numbers[0] == k], ranges=samples.ranges[numbers[1] == k])
        for k in range(int(numbers[0].max()) + 1)
    ]


def poses_of(engine: FleetEngine, batches: list[SampleBatch]) -> Any:
    return np.concatenate([np.zeros(0, POSE), *(engine.process(batch).poses for batch in batches)])


def holds_truth(poses: Any, runs: list[Simulation]) -> Any:
    """Return whether the truth lies in the 95 % ellipse of each pose."""
    inside = []
    for pose in poses:
        truth, t_s = runs[pose["row"]].truth, pose["t_ns"] * 1e-9
        e = np.array([pose[axis] - np.interp(t_s, truth.t_s, getattr(truth, axis)) for axis in ("x", "y")])
        inside.append(e @ np.linalg.solve(pose["cov"][:2, :2], e) < CHI2_95_OF_2)
    return np.array(inside)


def test_a_tag_of_which_every_fifth_message_arrives_keeps_its_last_place_without_any_hypothesis(
    runs: list[Simulation],
) -> None:
    engine = engine_of(runs)
    poses = poses_of(engine, in_messages(samples_of(runs, lambda number: number % 5 == 0)))
    after = poses[poses["t_ns"] > (FIRST + 10) * MESSAGE_NS]
    assert set(after["state"].tolist()) == {State.DEGRADED, State.LOST}
    assert (engine.state()["rows"]["count"] == 0).all()
    assert holds_truth(after, runs).mean() > 0.95


def test_after_gaps_it_begins_again_with_a_bounded_number_of_hypotheses_and_an_ellipse_to_be_believed(
    runs: list[Simulation],
) -> None:
    engine, most, poses = engine_of(runs), 0, []
    for batch in in_messages(samples_of(runs, lambda number: number % 50 > 3)):
        poses.append(engine.process(batch).poses)
        rows = engine.state()["rows"]
        most = max(most, int(rows["count"][rows["start"]["coarse"] == 1].max(initial=0)))
    after = np.concatenate(poses)
    after = after[(after["t_ns"] > 50 * MESSAGE_NS) & (after["t_ns"] < 100 * MESSAGE_NS)]
    assert 1 < most <= Tuning().coarse_hypotheses
    assert {State.AMBIGUOUS, State.DEGRADED} <= set(after["state"].tolist())
    assert holds_truth(after, runs).mean() > 0.8


def test_tags_after_gaps_begin_again_one_after_another(runs: list[Simulation]) -> None:
    engine, begun, poses = engine_of(runs), [], []
    for batch in in_messages(samples_of(runs, lambda number: (number % 5 == 0) | (number > 100))):
        poses.append(engine.process(batch).poses)
        begun.append(int((engine.state()["rows"]["count"] > 0).sum()))
    in_time = begun[101 : 101 + round((RESUME_ANYWHERE_AFTER + RESTART_SPREAD + 1.0) / 0.2)]
    assert begun[100] == 0
    assert in_time[-1] == len(runs)
    assert max(np.diff(in_time)) < len(runs) / 2
    published = np.concatenate(poses)
    nowhere = np.isnan(published["x"]) & (published["t_ns"] > FIRST * MESSAGE_NS)
    assert set(published["state"][nowhere].tolist()) == {State.INITIALISING}


def test_what_happens_around_gaps_does_not_depend_on_how_samples_were_cut_into_batches(runs: list[Simulation]) -> None:
    samples = samples_of(runs[:2], lambda number: number % 7 > 3)
    whole, parts = engine_of(runs[:2]), engine_of(runs[:2])
    at_once, in_parts = poses_of(whole, [samples]), poses_of(parts, in_messages(samples))
    for row in range(2):
        assert at_once[at_once["row"] == row].tobytes() == in_parts[in_parts["row"] == row].tobytes()

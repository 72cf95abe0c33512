"""The offset of the IMU's clock shows from a whole recording, or not at all."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from dropanchor_service.estimation.columns import IMU, RANGE, SampleBatch
from dropanchor_service.offline.clock_offset import is_large, motion_offset
from dropanchor_service.offline.replay import NS_PER_S, samples_of
from dropanchor_service.store.clock_offsets import MotionOffset
from dropanchor_tag_client.recording import read_recording
from dropanchor_tag_client.simulator.live import simulation
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from dropanchor_tag_client.simulator.walking import simulate_walk
from support.recordings import recording_or_skip

SENSORS = preset("real", imu_hz=50.0)


@cache  # each offset is looked for in the same drives
def yard(seed: int, duration_s: float = 120.0) -> Simulation:
    return simulation("yard", seed, seed % 4, SENSORS, duration_s)


def found(run: Simulation, ahead_s: float = 0.0) -> MotionOffset | None:
    imu, ranges = np.zeros(len(run.imu.t_s), IMU), np.zeros(len(run.ranges.t_s), RANGE)
    imu["t_ns"] = np.round((run.imu.t_s + ahead_s) * NS_PER_S)
    imu["acc"], imu["gyro"] = run.imu.acc, run.imu.gyro
    ranges["t_ns"], ranges["range"] = np.round(run.ranges.t_s * NS_PER_S), run.ranges.range_m
    return motion_offset(SampleBatch(imu=imu, ranges=ranges))


@pytest.mark.parametrize("ahead_s", [-3.1, -0.5, 0.5, 2.0, 7.0])
def test_offsets_of_drives_are_found(ahead_s: float) -> None:
    answers = [found(yard(seed), ahead_s) for seed in range(7000, 7006)]
    told = [answer for answer in answers if answer is not None]
    assert len(told) >= 3
    assert all(abs(answer.offset_s - ahead_s) <= answer.uncertainty_s for answer in told)
    assert all(map(is_large, told))


def test_drives_and_walks_on_one_clock_are_not_shifted() -> None:
    runs = [yard(seed) for seed in range(7000, 7012)]
    runs += [simulate_walk(how, seed) for how in ("pocket", "hand") for seed in range(7000, 7004)]
    runs += [simulate(scenario, 7000, SENSORS) for scenario in ("forklift", "OU", "RV", "SG", "M5", "C5", "L1")]
    answers = [found(run) for run in runs]
    assert [answer for answer in answers if answer is not None and is_large(answer)] == []


def test_a_short_recording_is_not_shifted() -> None:
    assert found(yard(7003, duration_s=30.0), 2.0) is None


@pytest.mark.recordings
@pytest.mark.parametrize(
    "name", ["iasl_s1", "iasl_s3", "mower", "inrol_1", "cf_circle_xy", "phones/ms00_front", "phones/ms04_rot"]
)
def test_real_recordings_on_one_clock_are_not_shifted(name: str) -> None:
    recording = read_recording(Path(recording_or_skip(name)))
    for anchor in sorted(set(recording.range_anchors))[:2]:
        offset = motion_offset(samples_of(recording, [anchor]).batch)
        assert offset is None or not is_large(offset)

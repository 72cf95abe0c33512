"""The runs behind a row: samples, settings and truth of every tag, simulated or recorded."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dropanchor_evaluation.product import disturbances
from dropanchor_evaluation.product.rows import BARE, CARRIED, FAST, Row
from dropanchor_evaluation.recordings import settings_of
from dropanchor_evaluation.simulated import START_STD, Feed, samples_of
from dropanchor_evaluation.simulated import truth_of as simulated_truth
from dropanchor_service.estimation.columns import Array, HeadingSource, SampleBatch, anchors_at, default_settings
from dropanchor_service.offline.accuracy import Truth
from dropanchor_service.offline.replay import NS_PER_S, anchors_of, truth_of
from dropanchor_service.offline.replay import samples_of as recorded_samples
from dropanchor_tag_client.recording import Recording, RecordingError, read_recording
from dropanchor_tag_client.simulator.ground import smooth
from dropanchor_tag_client.simulator.perturbations import perturbed
from dropanchor_tag_client.simulator.sensors import SensorModels, calibrated, preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from dropanchor_tag_client.simulator.walking import simulate_walk, walking_sensors

IMU_HZ = 100.0
RANGE_HZ = 10.0
MOUNT = 17  # random stream of `mounting_angle`


@dataclass(frozen=True)
class TagRun:
    """One tag. samples: of row 0, from t = 0 on. anchors: ANCHOR; ranges are to the first one.

    no_north: the samples do not determine north, so the track is scored up to a rotation about the anchor.
    """

    name: str
    samples: SampleBatch
    settings: Array
    truth: Truth
    anchors: Array
    no_north: bool


@dataclass(frozen=True)
class RecordedRun:
    """One recording with one of its anchors."""

    recording: Recording
    anchor: str


Source = Simulation | RecordedRun


def sources(row: Row, seeds: Sequence[int]) -> list[Source]:
    """Return the runs of a row. Rows with the same `runs_of` share them. Raises RecordingError."""
    if row.folders:
        return [one for folder in row.folders for one in _recorded(folder)]
    return [_simulated(row, seed) for seed in seeds]


def tag_run(row: Row, source: Source) -> TagRun:
    """Return the samples and the settings of the tag of a run."""
    return _of_recording(row, source) if isinstance(source, RecordedRun) else _of_simulation(row, source)


def mounting_angle(seed: int) -> float:
    """Return course minus body yaw, rad: N(0, 0.1) for half of the tags, N(0, 0.5) for the others."""
    rng = np.random.default_rng([seed, MOUNT])
    return float(rng.normal(0.0, 0.1 if rng.random() < 0.5 else 0.5))


def _simulated(row: Row, seed: int) -> Simulation:
    models = sensor_models(row)
    if row.scenario in CARRIED:
        return simulate_walk(row.scenario.removeprefix("walk-"), seed, walking_sensors(models))  # type: ignore[arg-type]
    turned = disturbances.mounting_angle(row.disturbance)
    mount = mounting_angle(seed) if turned is None else turned
    rest_s = disturbances.REST_S if row.disturbance.startswith(disturbances.RESTED) else 0.0
    return simulate(row.scenario, seed, replace(models, mount_rad=mount), rest_s)


def sensor_models(row: Row) -> SensorModels:
    """Return the sensors of the tags of a row, without their mounting angles."""
    if row.motion.endswith(FAST):
        return calibrated(preset("paper", range_hz=IMU_HZ, imu_hz=IMU_HZ))
    models = preset("real", range_hz=RANGE_HZ, imu_hz=IMU_HZ)
    models = models if row.sensors == BARE else calibrated(models)
    if row.disturbance in disturbances.FIELD:
        models = perturbed(models, row.disturbance)
    if (std := disturbances.gyro_bias_std(row.disturbance)) is not None:
        models = replace(models, imu=replace(models.imu, gyro_bias_std=std))
    models = smooth(models) if row.scenario == "rolling" else models
    if row.disturbance == disturbances.QUIET:
        models = replace(models, imu=replace(models.imu, acc_std=0.02, gyro_std=0.0015))
    return models


def _of_simulation(row: Row, run: Simulation) -> TagRun:
    feed = _feed(row)
    samples = samples_of(run, feed)
    disturbances.disturb_ranges(samples.ranges, row.disturbance, run.seed)
    return TagRun(
        name=str(run.seed),
        samples=samples,
        settings=_settings(row, run),
        truth=simulated_truth(run),
        anchors=anchors_at(*((a.x, a.y, a.z) for a in run.anchors)),
        no_north=feed == "raw 6-axis" and row.start == "unknown",
    )


def _feed(row: Row) -> Feed:
    if row.sensors == "scalar":
        return "raw 6-axis and heading" if row.scenario in CARRIED else "level"
    return "raw 6-axis" if row.sensors == "6-axis" else "raw"


def _settings(row: Row, run: Simulation) -> Array:
    truth, settings = run.truth, default_settings()
    settings["height"] = truth.z[0]
    settings["heading_source"] = HeadingSource.PLATFORM if row.sensors == "scalar" else HeadingSource.IMU
    if row.configured != "nothing":
        settings["mount_angle"] = _mount(run)
    if row.configured == "everything":
        _configure_everything(row, run, settings)
    if row.start == "known":
        settings["start_known"], settings["start_std"] = True, START_STD
        settings["start_x"], settings["start_y"] = truth.x[0], truth.y[0]
        settings["start_heading"] = math.nan if row.sensors == "scalar" else truth.heading[0]
    return settings


def _configure_everything(row: Row, run: Simulation, settings: Array) -> None:
    """Configure what is true of a simulated tag. A walker's device sways and its ranges are biased, so both stay."""
    settings["range_std"] = run.ranges.std_m[0]
    settings["reverse_allowed"] = row.scenario == "forklift"
    settings["magnetometer_calibrated"] = row.sensors == "9-axis"
    if row.scenario in CARRIED:
        return
    settings["range_bias_std"] = settings["mount_angle_std"] = settings["slip_std"] = 0.0
    settings["heading_std"] = 0.0


def _mount(run: Simulation) -> float:
    difference = run.truth.course - run.truth.heading
    return float(np.angle(np.exp(1j * difference).mean()))


def _recorded(folder: Path) -> list[Source]:
    recording = read_recording(folder)
    return [RecordedRun(recording, anchor.id) for anchor in recording.anchors if anchor.id in recording.range_anchors]


def _of_recording(row: Row, source: RecordedRun) -> TagRun:
    recording = source.recording
    truth = truth_of(recording)
    if truth is None:
        raise RecordingError(f"recording {recording.name} has no truth to compare with")
    samples = recorded_samples(recording, [source.anchor]).batch
    index = [anchor.id for anchor in recording.anchors].index(source.anchor)
    samples.ranges["anchor"] = 0
    start = min(int(kind["t_ns"][0]) for kind in (samples.imu, samples.ranges, samples.headings) if len(kind))
    operator = settings_of(recording, float(samples.ranges["t_ns"][0]) / NS_PER_S)
    for kind in (samples.imu, samples.ranges, samples.headings):
        kind["t_ns"] -= start
    return TagRun(
        name=f"{recording.name}/{source.anchor}",
        samples=samples,
        settings=_recorded_settings(row, operator),
        truth=Truth(truth.t - start / NS_PER_S, truth.x, truth.y),
        anchors=anchors_of(recording)[index : index + 1],
        no_north=row.start == "unknown" and len(samples.imu) > 0,  # the rooms' axes are not those of the field
    )


def _recorded_settings(row: Row, operator: Array) -> Array:
    """Return those of the operator's settings that the row configures."""
    settings = operator.copy() if row.configured == "operator" else default_settings()
    kept = ["height"] + (["start_known", "start_x", "start_y", "start_heading"] if row.start == "known" else [])
    for name in kept:
        settings[name] = operator[name]
    return settings

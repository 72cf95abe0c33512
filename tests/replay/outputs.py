"""What an engine makes of a golden replay: five poses a second, with the innovation of the range behind each.

A column is a field of POSE, an entry of its covariance, or what INNOVATION says of the same range; `modes` is how many
places the engine lists for an ambiguous tag. An empty field is NaN.
"""

import csv
import math
from collections.abc import Callable
from pathlib import Path

from dropanchor_service.estimation.columns import Array, MeasurementKind, PoseBatch
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.smoother.smoothed import smoothed_poses
from dropanchor_service.estimation.fleet.smoother.trace import TracingEngine
from dropanchor_service.estimation.paper.engine import PaperEngine
from dropanchor_service.estimation.paper.parameters import TUNED
from dropanchor_service.estimation.protocols import Engine
from replay.samples import BATCH_S, FOLDER, NS_PER_S, anchors_of, read_batches, settings_of
from replay.scenarios import SCENARIOS, Scenario

POSE_FIELDS = ("x", "y", "heading", "speed", "yaw_rate", "p_mode", "sigma_pos", "sigma_obs")
COLUMNS = (
    *("t_s", "state", "reason", "anchor"),
    *POSE_FIELDS,
    *("cov_xx", "cov_xy", "cov_yy", "cov_xh", "cov_yh", "cov_hh"),
    *("innovation", "innovation_variance", "p_outlier", "fused", "modes"),
)
UPPER = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
Table = list[list[float]]


def fleet(name: str, scenario: Scenario) -> Table:
    return _online(FleetEngine(), name, scenario)


def paper(name: str, scenario: Scenario) -> Table:
    return _online(PaperEngine(TUNED), name, scenario)


def smoothed(name: str, scenario: Scenario, lag: float | None = None) -> Table:
    """Return the poses of the smoother that uses `lag` s of later data, or all."""
    engine = TracingEngine()
    _configure(engine, scenario)
    for batch in read_batches(name):
        engine.process(batch)
    every = round(BATCH_S * scenario.models.ranges.hz) if scenario.models.ranges.hz else 1
    return [[*_of_pose(pose), *[math.nan] * 5] for pose in smoothed_poses(engine, 0, lag).poses[::every]]


def smoothed_with_lag(name: str, scenario: Scenario) -> Table:
    return smoothed(name, scenario, 1.0)


ENGINES: dict[str, Callable[[str, Scenario], Table]] = {
    "fleet": fleet,
    "paper": paper,
    "smoothed": smoothed,
    "lagged": smoothed_with_lag,
}
SMOOTHED = ("turns", "nlos", "raw_9_axis")  # the scenarios that the smoother runs on, too
REPLAYS = [(name, engine) for name in SCENARIOS for engine in ("fleet", "paper")] + [
    (name, engine) for name in SMOOTHED for engine in ("smoothed", "lagged")
]


def replay(name: str, engine: str) -> Table:
    """Return COLUMNS of every pose that is kept."""
    return ENGINES[engine](name, SCENARIOS[name])


def replay_with(engine: Engine, name: str) -> Table:
    """Return COLUMNS of every pose that is kept of a fresh engine."""
    return _online(engine, name, SCENARIOS[name])


def expected_path(name: str, engine: str) -> Path:
    return FOLDER / f"{name}.{engine}.expected.csv"


def write_expected(name: str, engine: str) -> None:
    with expected_path(name, engine).open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([_text(value) for value in row] for row in replay(name, engine))


def read_expected(name: str, engine: str) -> Table:
    """Return the rows of the file; raises ValueError where its columns are not COLUMNS."""
    with expected_path(name, engine).open(newline="") as file:
        header, *rows = csv.reader(file)
    if tuple(header) != COLUMNS:
        raise ValueError(f"{expected_path(name, engine).name} has other columns: run `python -m replay.rewrite`")
    return [[float(value or "nan") for value in row] for row in rows]


def _configure(engine: Engine, scenario: Scenario) -> None:
    engine.set_anchors(anchors_of(scenario))
    engine.configure(0, settings_of(scenario))


def _online(engine: Engine, name: str, scenario: Scenario) -> Table:
    """Return the last pose of every batch of 0.2 s: the modes of a batch are those of its last pose."""
    _configure(engine, scenario)
    batches = [engine.process(batch) for batch in read_batches(name)]
    return [[*_of_pose(batch.poses[-1]), *_of_range(batch)] for batch in batches if len(batch.poses)]


def _of_pose(pose: Array) -> list[float]:
    values = [pose[field] for field in ("state", "reason", "anchor", *POSE_FIELDS)]
    return [float(pose["t_ns"]) / NS_PER_S, *map(float, values), *(float(pose["cov"][i, j]) for i, j in UPPER)]


def _of_range(batch: PoseBatch) -> list[float]:
    """Return what the innovation of the last pose's range says, NaN if there is none, and the number of modes."""
    records, pose = batch.innovations, batch.poses[-1]
    own = records[(records["kind"] == MeasurementKind.RANGE) & (records["t_ns"] == pose["t_ns"])]
    values = (
        [float(own[-1][field]) for field in ("innovation", "S", "p_outlier", "fused")] if len(own) else [math.nan] * 4
    )
    return [*values, float(len(batch.hypotheses))]


def _text(value: float) -> str:
    """Return nine significant digits: a hundredth of the tolerance at most."""
    return "" if math.isnan(value) else f"{value:.9g}"

"""Write a simulation as a recording, a folder of plain CSV files."""

import csv
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dropanchor_tag_client.simulator.scalar import wrapped
from dropanchor_tag_client.simulator.simulation import Simulation
from dropanchor_tag_client.simulator.trajectory import Array

IMU_HEADER = ("t_s", "ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz")
TRUTH_HEADER = ("t_s", "x", "y", "z", "qw", "qx", "qy", "qz", "yaw_rad")


def write_recording(simulation: Simulation, folder: Path, platform_heading: bool = False) -> None:
    """Write range, imu, truth and anchors (CSV) and meta (JSON). With `platform_heading`, also write the heading.

    Times have microseconds, other numbers nine digits. The folder may exist.
    """
    folder.mkdir(parents=True, exist_ok=True)
    truth, imu, scalars = simulation.truth, simulation.imu, simulation.scalars
    _write_ranges(folder / "range.csv", simulation)
    _write(folder / "imu.csv", IMU_HEADER, (imu.t_s, *imu.acc.T, *imu.gyro.T, *_measured(imu.mag)))
    columns = (truth.t_s, truth.x, truth.y, truth.z, *truth.attitude.T, wrapped(truth.heading))
    _write(folder / "truth.csv", TRUTH_HEADER, columns)
    if platform_heading:
        _write(folder / "heading.csv", ("t_s", "yaw_rad"), (scalars.t_s, scalars.heading_rad))
    _write_rows(folder / "anchors.csv", ("id", "x", "y", "z"), simulation.anchors)
    (folder / "meta.json").write_text(json.dumps(_meta(simulation), indent=1) + "\n")


def _write_ranges(path: Path, simulation: Simulation) -> None:
    ranges = simulation.ranges
    ids = [simulation.anchors[index].id for index in ranges.anchor]
    _write_rows(
        path,
        ("t_s", "anchor_id", "range_m", "std_m"),
        zip(_times(ranges.t_s), ids, _numbers(ranges.range_m), _numbers(ranges.std_m), strict=True),
    )


def _measured(mag: Array) -> Sequence[Array]:
    return () if np.isnan(mag).all() else tuple(mag.T)


def _write(path: Path, header: Sequence[str], columns: Sequence[Array]) -> None:
    rows = zip(_times(columns[0]), *(_numbers(column) for column in columns[1:]), strict=True)
    _write_rows(path, header[: len(columns)], rows)


def _times(column: Array) -> list[str]:
    return [f"{t:.6f}" for t in column]


def _numbers(column: Array) -> list[str]:
    return [f"{value:.9g}" for value in column]


def _write_rows(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def _meta(simulation: Simulation) -> dict[str, Any]:
    truth, ranges = simulation.truth, simulation.ranges
    duration = float(truth.t_s[-1] - truth.t_s[0])
    return {
        "name": f"{simulation.scenario}-{simulation.seed}",
        "description": f"Simulated: scenario {simulation.scenario}, seed {simulation.seed}",
        "frames": "x east, y north, z up; body x forward, y left, z up; magnetometer in µT",
        "planar_ranges": bool(all(anchor.z == truth.z[0] for anchor in simulation.anchors)),
        "rates_hz": {
            "range_total": round(len(ranges.t_s) / duration, 3),
            "imu": round((len(truth.t_s) - 1) / duration, 3),
        },
        "motion": {"duration_s": round(duration, 6)},
    }

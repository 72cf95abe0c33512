"""A simulation survives writing and reading as a recording in plain CSV files."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dropanchor_tag_client.simulator.perturbations import perturbed
from dropanchor_tag_client.simulator.recording import write_recording
from dropanchor_tag_client.simulator.scalar import wrapped
from dropanchor_tag_client.simulator.sensors import PRESETS
from dropanchor_tag_client.simulator.simulation import simulate
from dropanchor_tag_client.simulator.trajectory import Array


def columns_of(path: Path) -> dict[str, list[str]]:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def numbers(path: Path, *names: str) -> Array:
    columns = columns_of(path)
    return np.array([[float(value) for value in columns[name]] for name in names]).T


def test_a_recording_contains_the_whole_simulation(tmp_path: Path) -> None:
    run = simulate("M5", 9, perturbed(PRESETS["real"], "nlos10", "late15"))
    write_recording(run, tmp_path / "new" / "m5", platform_heading=True)
    folder = tmp_path / "new" / "m5"
    ranges = numbers(folder / "range.csv", "t_s", "range_m", "std_m")
    assert ranges[:, 0] == pytest.approx(run.ranges.t_s, abs=1e-6)
    assert ranges[:, 1:] == pytest.approx(np.column_stack([run.ranges.range_m, run.ranges.std_m]), rel=1e-8)
    assert set(columns_of(folder / "range.csv")["anchor_id"]) == {"1"}
    imu = numbers(folder / "imu.csv", "ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz")
    assert imu == pytest.approx(np.hstack([run.imu.acc, run.imu.gyro, run.imu.mag]), rel=1e-8)
    truth = numbers(folder / "truth.csv", "x", "y", "z", "yaw_rad")
    expected = np.column_stack([run.truth.x, run.truth.y, run.truth.z, wrapped(run.truth.heading)])
    assert truth == pytest.approx(expected, rel=1e-8, abs=1e-8)
    assert numbers(folder / "truth.csv", "qw", "qx", "qy", "qz") == pytest.approx(run.truth.attitude, abs=1e-8)
    heading = numbers(folder / "heading.csv", "t_s", "yaw_rad")
    assert heading[:, 1] == pytest.approx(run.scalars.heading_rad, abs=1e-8)
    assert columns_of(folder / "anchors.csv") == {"id": ["1"], "x": ["0.0"], "y": ["0.0"], "z": ["0.0"]}
    assert json.loads((folder / "meta.json").read_text())["rates_hz"]["range_total"] == pytest.approx(10.0, abs=0.1)


def test_the_heading_file_is_written_on_request_only(tmp_path: Path) -> None:
    write_recording(simulate("L1", 0), tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"range.csv", "imu.csv", "truth.csv", "anchors.csv", "meta.json"}


def test_a_level_imu_has_no_magnetometer_columns(tmp_path: Path) -> None:
    run = simulate("M5", 1)
    level = run.level_imu()
    assert level.acc[:, 0] == pytest.approx(run.scalars.acceleration_mps2)
    assert level.gyro[:, 2] == pytest.approx(run.scalars.gyro_radps)
    write_recording(replace(run, imu=level), tmp_path)
    assert list(columns_of(tmp_path / "imu.csv")) == ["t_s", "ax", "ay", "az", "gx", "gy", "gz"]

"""A replay checks the sensors of a recording as those of a live tag are checked."""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dropanchor_service.cli import main
from dropanchor_tag_client.simulator.recording import write_recording
from dropanchor_tag_client.simulator.simulation import Simulation
from support.sensor_faults import GRAVITY, mean_of, run_of


@pytest.fixture(scope="module")
def run() -> Simulation:
    return run_of("forklift", 47_300)


def changed(folder: Path, run: Simulation, file: str, columns: list[str], change: Callable[[float], float]) -> Path:
    """Write the run as a recording in which these columns of a file are changed."""
    write_recording(run, folder)
    rows = table(folder / f"{file}.csv")
    for row in rows:
        row.update({name: repr(change(float(row[name]))) for name in columns})
    with (folder / f"{file}.csv").open("w", newline="") as out:
        writer = csv.DictWriter(out, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return folder


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def poses(folder: Path, *options: str) -> list[dict[str, str]]:
    assert main(["replay", str(folder), "--out", str(folder / "poses.csv"), *options]) == 0
    return table(folder / "poses.csv")


ACC = ["ax", "ay", "az"]


def test_accelerations_in_g_are_named_and_the_told_unit_mends_them(
    run: Simulation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = changed(tmp_path, run, "imu", ACC, lambda value: value / GRAVITY)
    assert {pose["state"] for pose in poses(folder)} == {"initialising"}
    assert "The accelerations look like g, not m/s²" in capsys.readouterr().out
    (tmp_path / "yard.toml").write_text('[tag_defaults]\nacc_unit = "g"\n')
    for options in (["--acc-unit", "g"], ["--config", str(tmp_path / "yard.toml")]):
        assert "tracking" in {pose["state"] for pose in poses(folder, *options)}
        assert "look like g" not in capsys.readouterr().out


def test_what_shows_late_in_a_recording_of_averaged_ranges_holds_from_its_start(
    run: Simulation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    averaged = iter(mean_of(10)(np.asarray(run.ranges.range_m)).tolist())
    folder = changed(tmp_path, run, "range", ["range_m"], lambda _: next(averaged))
    start = f"--start={run.truth.x[0]},{run.truth.y[0]},{run.truth.heading[0]}"
    assert "tracking" not in {pose["state"] for pose in poses(folder, start)}
    said = capsys.readouterr().out
    assert "from 0.0 s on: The module averages about 10 ranges" in said
    assert "never tracking; after the best rotation" in said


def test_ranges_in_millimetres_of_which_few_are_possible_are_not_believed(
    run: Simulation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = changed(tmp_path, run, "range", ["range_m", "std_m"], lambda value: 1000.0 * value)
    if main(["replay", str(folder), "--out", str(folder / "poses.csv")]) == 0:
        assert "tracking" not in {pose["state"] for pose in table(folder / "poses.csv")}
    assert "range_absurd" in "".join(capsys.readouterr())
    assert "tracking" in {pose["state"] for pose in poses(folder, "--range-unit", "mm")}

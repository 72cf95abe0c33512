"""Call `dropanchor replay` in this process, on recordings that are simulated here and given one fault."""

import argparse
import contextlib
import csv
import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dropanchor_service.commands import replay
from dropanchor_tag_client.simulator.live import simulation
from dropanchor_tag_client.simulator.recording import write_recording
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation

Table = list[dict[str, str]]
Change = Callable[[dict[str, str]], None]


def yard(duration_s: float = 100.0, seed: int = 7003) -> Simulation:
    """Return a drive in the yard, with turns and stops."""
    return simulation("yard", seed, seed % 4, preset("real", imu_hz=50.0), duration_s)


def start_of(run: Simulation) -> str:
    truth = run.truth
    return f"--start={truth.x[0]:.3f},{truth.y[0]:.3f},{truth.heading[0]:.3f}"


def write_changed(run: Simulation, folder: Path, **changes: Change) -> Path:
    """Write the run as a recording. changes: by table (range, imu, truth), what is done to each of its rows."""
    write_recording(run, folder)
    for name, change in changes.items():
        rows = read_rows(folder / f"{name}.csv")
        for row in rows:
            change(row)
        write_rows(folder / f"{name}.csv", rows)
    return folder


def read_rows(path: Path) -> Table:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def write_rows(path: Path, rows: Table) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def times(change: Callable[[float], object]) -> Change:
    """Return what changes the time of a row."""

    def changed(row: dict[str, str]) -> None:
        row["t_s"] = str(change(float(row["t_s"])))

    return changed


@dataclass(frozen=True)
class Replayed:
    status: int
    out: str
    error: str


def call(*arguments: str | Path) -> Replayed:
    parser = argparse.ArgumentParser()
    replay.add_arguments(parser)
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        status = replay.run(parser.parse_args([str(argument) for argument in arguments]))
    return Replayed(status, out.getvalue(), error.getvalue())


def wrong_while_tracking(poses: Path, run: Simulation, start_s: float = 0.0) -> tuple[int, int]:
    """Return how many poses are in the state tracking, and how many of these are more than 5 sigma off.

    start_s: time of the recording at which the run begins.
    """
    tracking = [row for row in read_rows(poses) if row["state"] == "tracking"]
    wrong = 0
    for row in tracking:
        t = float(row["t_s"]) - start_s
        x, y = (float(np.interp(t, run.truth.t_s, column)) for column in (run.truth.x, run.truth.y))
        error = np.array([float(row["x"]) - x, float(row["y"]) - y])
        xx, xy, yy = (float(row[name]) for name in ("var_x", "cov_xy", "var_y"))
        wrong += math.sqrt(error @ np.linalg.solve([[xx, xy], [xy, yy]], error)) > 5.0
    return len(tracking), wrong

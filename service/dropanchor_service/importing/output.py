"""Write the folder of a recording: whole, or not at all."""

import csv
import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.join import Joined
from dropanchor_service.importing.progress import shown
from dropanchor_service.importing.readings import ImportingError, Position
from dropanchor_tag_client.recording.columns import FILES, HEADING, IMU, PRESSURE, TRUTH

_FILES = tuple(f"{file.name}.csv{end}" for file in FILES for end in ("", ".gz"))


def require_free(folder: Path, force: bool) -> None:
    """Raise ImportingError unless the recording may be written there. force: a recording there may be replaced."""
    if folder.exists() and not folder.is_dir():
        raise ImportingError(f"{folder} is a file: --out names a folder")
    if folder.is_dir() and any(folder.iterdir()) and not force:
        raise ImportingError(
            f"{folder} is not empty: choose another folder, or replace the recording in it with --force"
        )


def write_recording(folder: Path, joined: Joined, anchors: dict[str, Position]) -> None:
    """Write the recording. Files of another one in the folder are replaced, files that are no recording stay."""
    with _part_of(folder) as part:
        _write(part / "anchors.csv", ("id", "x", "y", "z"), ((name, *place) for name, place in anchors.items()))
        ranges, imu, headings = joined.ranges, joined.imu, joined.headings
        rows = zip(_times(ranges.t_ns), ranges.anchors, _numbers(ranges.range_m), _numbers(ranges.std_m), strict=True)
        _write(part / "range.csv", ("t_s", "anchor_id", "range_m", "std_m"), rows)
        if len(imu):
            columns = [*imu.acc.T, *imu.gyro.T, *([] if np.isnan(imu.mag).all() else imu.mag.T)]
            _write_columns(part / "imu.csv", ("t_s", *IMU.numbers[: len(columns)]), imu.t_ns, columns)
        if len(headings):
            columns = [headings.yaw_rad, headings.std_rad]
            _write_columns(part / "heading.csv", ("t_s", *HEADING.numbers), headings.t_ns, columns)
        if len(joined.pressures):
            columns = list(joined.pressures.values.T)
            header = ("t_s", *PRESSURE.numbers[: len(columns)])
            _write_columns(part / "pressure.csv", header, joined.pressures.t_ns, columns)
        if len(joined.truth):
            known = ~np.isnan(joined.truth.values).all(0)
            header = ("t_s", *np.array(TRUTH.numbers)[known].tolist())
            _write_columns(part / "truth.csv", header, joined.truth.t_ns, list(joined.truth.values.T[known]))


@contextmanager
def _part_of(folder: Path) -> Iterator[Path]:
    """Provide a folder beside the other one, and move its files there at the end unless something fails."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    part = folder.resolve().with_name(f".{folder.resolve().name}.{os.getpid()}.part")
    part.mkdir()
    try:
        yield part
        if folder.is_dir() and any(folder.iterdir()):
            _replace(part, folder)
        else:
            os.replace(part, folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _replace(part: Path, folder: Path) -> None:
    new = {path.name for path in part.iterdir()}
    for name in new:
        os.replace(part / name, folder / name)
    for name in set(_FILES) - new:
        (folder / name).unlink(missing_ok=True)


def _write_columns(path: Path, header: Sequence[str], t_ns: Array, columns: Sequence[Array]) -> None:
    _write(path, header, zip(_times(t_ns), *map(_numbers, columns), strict=True))


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(shown(rows, path.name))


def _times(t_ns: Array) -> Iterator[str]:
    for t in t_ns.tolist():
        seconds, ns = divmod(abs(t), 1_000_000_000)
        yield f"{'-' if t < 0 else ''}{seconds}.{ns:09d}"


def _numbers(column: Array) -> Iterator[str]:
    for value in column.tolist():
        yield "" if value != value else f"{value:.10g}"  # NaN is an empty cell

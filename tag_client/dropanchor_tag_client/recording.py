"""Read recordings: folders of CSV files, plain or gzipped, with the samples of a tag and optionally the truth."""

import csv
import gzip
import io
import math
import zlib
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path


class RecordingError(ValueError):
    """The folder is not a recording, or one of its files cannot be read. The message says where and what is wrong."""


@dataclass(frozen=True)
class Anchor:
    """An anchor and its position in the frame of the recording, m."""

    id: str
    x: float
    y: float
    z: float


@dataclass(frozen=True)
class Recording:
    """The columns of a recording in order of time, in SI units. A missing file gives empty columns.

    ranges: t_s, range_m, std_m (NaN: unknown); `range_anchors` holds the anchor id of each range.
    imu: t_s, ax ay az, gx gy gz, mx my mz (NaN: no magnetometer). headings: t_s, yaw_rad, std_rad (NaN: unknown).
    truth: t_s, x, y, z, yaw_rad.
    """

    name: str
    anchors: tuple[Anchor, ...]
    range_anchors: tuple[str, ...]
    ranges: dict[str, "array[float]"]
    imu: dict[str, "array[float]"] = field(default_factory=dict)
    headings: dict[str, "array[float]"] = field(default_factory=dict)
    truth: dict[str, "array[float]"] = field(default_factory=dict)

    def anchor(self, identifier: str) -> Anchor:
        """Return the anchor with this id. Raises RecordingError, which lists the ids, if there is none."""
        for anchor in self.anchors:
            if anchor.id == identifier:
                return anchor
        known = ", ".join(anchor.id for anchor in self.anchors)
        raise RecordingError(f"recording {self.name} has no anchor {identifier!r}; it has: {known}")


RANGE_COLUMNS = ("t_s", "range_m", "std_m")
IMU_COLUMNS = ("t_s", "ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz")
HEADING_COLUMNS = ("t_s", "yaw_rad", "std_rad")
TRUTH_COLUMNS = ("t_s", "x", "y", "z", "yaw_rad")
OPTIONAL = frozenset({"std_m", "std_rad", "mx", "my", "mz"})
MAY_BE_NAN = OPTIONAL | {"z", "yaw_rad"}


def read_recording(folder: Path | str) -> Recording:
    """Return the recording in a folder. Raises RecordingError.

    range.csv and anchors.csv are required; imu.csv, heading.csv and truth.csv are optional. Any file may be gzipped
    (range.csv.gz).
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise RecordingError(f"{folder} is not a folder; a recording is a folder with range.csv and anchors.csv")
    anchors = _anchors(folder)
    texts, ranges = _table(folder, "range", RANGE_COLUMNS, text="anchor_id")
    unknown = sorted(set(texts) - {anchor.id for anchor in anchors})
    if unknown:
        raise RecordingError(f"{folder}: ranges to {', '.join(unknown)}, which anchors.csv does not have")
    return Recording(
        name=folder.resolve().name,
        anchors=anchors,
        range_anchors=tuple(texts),
        ranges=ranges,
        imu=_table(folder, "imu", IMU_COLUMNS, required=False)[1],
        headings=_table(folder, "heading", HEADING_COLUMNS, required=False)[1],
        truth=_table(folder, "truth", TRUTH_COLUMNS, required=False)[1],
    )


def _anchors(folder: Path) -> tuple[Anchor, ...]:
    ids, columns = _table(folder, "anchors", ("x", "y", "z"), text="id")
    rows = zip(ids, columns["x"], columns["y"], columns["z"], strict=True)
    anchors = tuple(Anchor(*row) for row in rows)
    if not anchors:
        raise RecordingError(f"{folder / 'anchors.csv'} holds no anchor")
    if len(set(ids)) < len(ids):
        raise RecordingError(f"{folder / 'anchors.csv'} names an anchor twice")
    return anchors


def _table(
    folder: Path, name: str, columns: tuple[str, ...], text: str | None = None, required: bool = True
) -> tuple[list[str], dict[str, "array[float]"]]:
    """Return the text column and the number columns of a file, in order of time (a stable sort by t_s)."""
    path = _path(folder, name)
    texts: list[str] = []
    values = {column: array("d") for column in columns}
    if path is None:
        if required:
            raise RecordingError(f"{folder} has neither {name}.csv nor {name}.csv.gz")
        return texts, values
    for where, row in _rows(path, {*columns, *([text] if text else [])} - OPTIONAL):
        for column in columns:
            values[column].append(_number(row.get(column), column, where))
        if text:
            texts.append(_text(row[text], text, where))
    return _by_time(texts, values)


def _path(folder: Path, name: str) -> Path | None:
    return next((p for p in (folder / f"{name}.csv", folder / f"{name}.csv.gz") if p.is_file()), None)


def _rows(path: Path, needed: set[str]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield each row of the file with its location for error messages."""
    try:
        raw = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
        reader = csv.DictReader(io.StringIO(raw.decode("utf-8-sig")), restkey="")
        missing = needed - set(reader.fieldnames or ())
        if missing:
            raise RecordingError(f"{path} line 1: the columns {', '.join(sorted(missing))} are missing")
        for row in reader:
            if "" in row or None in row.values():
                raise RecordingError(
                    f"{path} line {reader.line_num}: {len(reader.fieldnames or ())} values were expected"
                )
            yield f"{path} line {reader.line_num}", row
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error


def _number(value: str | None, column: str, where: str) -> float:
    if value is None:
        return math.nan
    try:
        number = float(value) if value else math.nan
    except ValueError:
        raise RecordingError(f"{where}: {column} is {value!r}, a number was expected") from None
    if column == "t_s" and not math.isfinite(number):
        raise RecordingError(f"{where}: t_s is {value!r}, a finite number was expected")
    if math.isnan(number) and not value and column not in MAY_BE_NAN:
        raise RecordingError(f"{where}: {column} is empty, a number was expected")
    return number


def _text(value: str, column: str, where: str) -> str:
    if not value:
        raise RecordingError(f"{where}: {column} is empty")
    return value


def _by_time(texts: list[str], values: dict[str, "array[float]"]) -> tuple[list[str], dict[str, "array[float]"]]:
    times = values.get("t_s")
    if times is None or all(a <= b for a, b in pairwise(times)):
        return texts, values
    order = sorted(range(len(times)), key=times.__getitem__)
    texts = [texts[i] for i in order] if texts else texts
    return texts, {name: array("d", (column[i] for i in order)) for name, column in values.items()}

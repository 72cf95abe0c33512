"""What a recording holds, in memory."""

from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple


class RecordingError(ValueError):
    """The folder is not a recording, or one of its files cannot be read. The message says where and what is wrong."""


@dataclass(frozen=True)
class Anchor:
    """An anchor and its position in the frame of the recording, m."""

    id: str
    x: float
    y: float
    z: float


class Place(NamedTuple):
    """A row of a file, for messages. unit: `line` or `row`."""

    path: Path
    unit: str
    number: int

    def __str__(self) -> str:
        return f"{self.path} {self.unit} {self.number}"


class Rows(NamedTuple):
    """Where the rows of a table come from. file: its name. unit: `line` or `row`. numbers: of each row in the file."""

    file: str
    unit: str
    numbers: "array[int]"

    def place(self, row: int) -> str:
        """Return the name of the file and the line of a row."""
        return f"{self.file} {self.unit} {self.numbers[row]}"


@dataclass(frozen=True)
class Recording:
    """The columns of a recording in order of time, in SI units. A missing file gives empty columns.

    ranges: t_s, range_m, std_m (NaN: unknown); `range_anchors` holds the anchor id of each range.
    imu: t_s, ax ay az, gx gy gz, mx my mz (NaN: no magnetometer). headings: t_s, yaw_rad, std_rad (NaN: unknown).
    pressures: t_s, pressure_pa, temperature_c (NaN: unknown). truth: t_s, x, y, z, yaw_rad.
    rows: where the rows of each table come from, by its name (range, imu, heading, pressure, truth).
    notes: sentences on what was done to the times.
    """

    name: str
    anchors: tuple[Anchor, ...]
    range_anchors: tuple[str, ...]
    ranges: dict[str, "array[float]"]
    imu: dict[str, "array[float]"] = field(default_factory=dict)
    headings: dict[str, "array[float]"] = field(default_factory=dict)
    pressures: dict[str, "array[float]"] = field(default_factory=dict)
    truth: dict[str, "array[float]"] = field(default_factory=dict)
    rows: dict[str, Rows] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def anchor(self, identifier: str) -> Anchor:
        """Return the anchor with this id. Raises RecordingError, which lists the ids, if there is none."""
        for anchor in self.anchors:
            if anchor.id == identifier:
                return anchor
        known = ", ".join(anchor.id for anchor in self.anchors)
        raise RecordingError(f"recording {self.name} has no anchor {identifier!r}; it has: {known}")

    def place(self, table: str, row: int) -> str:
        """Return the file and the line of a row for messages."""
        return self.rows[table].place(row) if table in self.rows else f"{table} row {row + 1}"

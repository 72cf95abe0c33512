"""What a source holds: readings in SI units and the axes of the tag, and what was found on the way."""

from array import array
from collections.abc import Sequence, Sized
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.streams import Stream, make_stream, no_readings
from dropanchor_tag_client.recording.columns import RANGE as ANY_FILE
from dropanchor_tag_client.recording.order import in_order
from dropanchor_tag_client.recording.recording import Rows
from dropanchor_tag_client.recording.table import Table
from dropanchor_tag_client.recording.units import LATEST_S

ACC, GYRO, MAG, RANGE, HEADING, TIME = "acc", "gyro", "mag", "range", "heading", "time"
PRESSURE, TRUTH = "pressure", "truth"
MAX_EXAMPLES = 3
NS_PER_S = 1_000_000_000
LATEST_NS = round(
    LATEST_S * NS_PER_S
)  # a time may be nonsense: `bounded` keeps it within int64, `ordered` leaves it out

Position = tuple[float, float, float]


class ImportingError(ValueError):
    """The source cannot be imported. The text is a sentence that says what is wrong and what to do."""


@dataclass(frozen=True)
class Ranges:
    """Ranges in order of time. t_ns: (n,) int64. range_m, std_m: (n,), std NaN: unknown. anchors: n ids."""

    t_ns: Array
    anchors: tuple[str, ...]
    range_m: Array
    std_m: Array

    def __len__(self) -> int:
        return len(self.t_ns)


@dataclass(frozen=True)
class Headings:
    """Headings in order of time. t_ns: (n,) int64. yaw_rad, std_rad: (n,), std NaN: unknown."""

    t_ns: Array
    yaw_rad: Array
    std_rad: Array

    def __len__(self) -> int:
        return len(self.t_ns)


@dataclass(frozen=True)
class Unit:
    """The unit in which a source has a quantity, and where. name: None if nobody told; then SI was assumed.

    given: the words that a `--map` would give for it, without units.
    """

    name: str | None
    given: tuple[str, ...] = ()


class LeftOut:
    """Counts of rows that were left out, by source and reason, with the first few lines. notes: on their times."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self._lines: dict[tuple[str, str], list[int]] = {}
        self._counts: dict[tuple[str, str], int] = {}

    def add(self, source: str, reason: str, line: int | None = None, count: int = 1) -> None:
        if not count:
            return
        key = source, reason
        self._counts[key] = self._counts.get(key, 0) + count
        lines = self._lines.setdefault(key, [])
        if line is not None and len(lines) < MAX_EXAMPLES:
            lines.append(line)

    def add_all(self, other: "LeftOut") -> None:
        self.notes += other.notes
        for (source, reason), count in other._counts.items():
            self.add(source, reason, count=count)
            known = self._lines[source, reason]
            known += other._lines[source, reason][: MAX_EXAMPLES - len(known)]

    def sentences(self) -> list[str]:
        return [*dict.fromkeys(self.notes), *(self._sentence(*key) for key in self._counts)]

    def _sentence(self, source: str, reason: str) -> str:
        count, lines = self._counts[source, reason], self._lines[source, reason]
        if not lines:
            return f"{source}: {count} left out: {reason}"
        more = ", …" if count > len(lines) else ""
        where = f"line{'s' if count > 1 else ''} {', '.join(map(str, lines))}{more}"
        return f"{source}: {count} left out: {reason} ({where})"


def no_ranges() -> Ranges:
    return Ranges(np.empty(0, np.int64), (), np.empty(0), np.empty(0))


def no_headings() -> Headings:
    return Headings(np.empty(0, np.int64), np.empty(0), np.empty(0))


@dataclass
class Readings:
    """What one source or several hold. notes: what was decided and converted, for the person. units: by quantity.

    pressure: Pa, and in a second column the temperature of the air, °C, where it is known. truth: x, y, z, m, and yaw,
    rad, of which the last two are NaN where the source has none.
    """

    acc: Stream = field(default_factory=no_readings)
    gyro: Stream = field(default_factory=no_readings)
    mag: Stream = field(default_factory=no_readings)
    pressure: Stream = field(default_factory=no_readings)
    truth: Stream = field(default_factory=no_readings)
    ranges: Ranges = field(default_factory=no_ranges)
    headings: Headings = field(default_factory=no_headings)
    anchors: dict[str, Position] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    left_out: LeftOut = field(default_factory=LeftOut)
    units: dict[str, Unit] = field(default_factory=dict)

    @property
    def is_empty(self) -> bool:
        held: tuple[Sized, ...] = (
            self.acc,
            self.gyro,
            self.mag,
            self.pressure,
            self.truth,
            self.ranges,
            self.headings,
            self.anchors,
        )
        return not any(map(len, held))


def bounded_ns(seconds: Array) -> Array:
    """Return ns, of nonsense the latest time that there is."""
    ns: Array = np.rint(np.clip(seconds, -LATEST_S, LATEST_S) * NS_PER_S).astype(np.int64)
    return ns


def stream_of(t_ns: Array, values: Array, rows: Rows, what: str, left_out: LeftOut) -> Stream:
    """Return the readings in order of time, one for each time. Count those whose time another has.

    rows: where each of them stands. Raises RecordingError, as the two below, where the time goes back.
    """
    t_ns, order = ordered(t_ns, rows, what, left_out)
    stream = make_stream(t_ns, values[order])
    left_out.add(rows.file, f"{what} with the time of another", count=len(t_ns) - len(stream))
    return stream


def ranges_of(t_ns: Array, anchors: Sequence[str], columns: Sequence[Array], rows: Rows, left_out: LeftOut) -> Ranges:
    """Return the ranges in order of time. columns: range_m, std_m. Those to one anchor stand in the order of time."""
    t_ns, order = ordered(t_ns, rows, "ranges", left_out, anchors)
    range_m, std_m = (column[order] for column in columns)
    return Ranges(t_ns, tuple(anchors[i] for i in order.tolist()), range_m, std_m)


def headings_of(t_ns: Array, columns: Sequence[Array], rows: Rows, left_out: LeftOut) -> Headings:
    """Return the headings in order of time. columns: yaw_rad, std_rad."""
    t_ns, order = ordered(t_ns, rows, "headings", left_out)
    return Headings(t_ns, *(column[order] for column in columns))


def ordered(t_ns: Array, rows: Rows, holds: str, left_out: LeftOut, series: Sequence[str] = ()) -> tuple[Array, Array]:
    """Return the times in order, and the places of their rows, by the rules of all recordings. Raises RecordingError.

    series: which rows follow each other.
    """
    if not len(t_ns):
        return t_ns, np.empty(0, np.int64)
    middle_ns = int(np.median(t_ns))
    if abs(middle_ns) >= LATEST_NS:
        raise ImportingError(
            f"{rows.place(0)}: the time of this and most other {holds} is after 2116: in which unit is it?"
        )
    since_s = (t_ns - middle_ns) / NS_PER_S
    table = Table(ANY_FILE._replace(holds=holds), Path(rows.file), t=array("d", since_s), texts=list(series), rows=rows)
    kept, notes = in_order(table)
    left_out.notes += notes
    order = np.array(kept, np.int64)
    continued_s = np.asarray(table.t) - since_s  # behind a counter that wrapped
    return (t_ns + np.rint(continued_s * NS_PER_S).astype(np.int64))[order], order

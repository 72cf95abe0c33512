"""What a source holds: readings in SI units and the axes of the tag, and what was found on the way."""

from collections.abc import Sequence, Sized
from dataclasses import dataclass, field

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.streams import Stream, make_stream, no_readings

ACC, GYRO, MAG, RANGE, HEADING, TIME = "acc", "gyro", "mag", "range", "heading", "time"
PRESSURE = "pressure"
MAX_EXAMPLES = 3

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
    """Counts of rows that were left out, by source and reason, with the first few lines."""

    def __init__(self) -> None:
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
        for (source, reason), count in other._counts.items():
            self.add(source, reason, count=count)
            known = self._lines[source, reason]
            known += other._lines[source, reason][: MAX_EXAMPLES - len(known)]

    def sentences(self) -> list[str]:
        return [self._sentence(*key) for key in self._counts]

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

    pressure: Pa, and in a second column the temperature of the air, °C, where it is known.
    """

    acc: Stream = field(default_factory=no_readings)
    gyro: Stream = field(default_factory=no_readings)
    mag: Stream = field(default_factory=no_readings)
    pressure: Stream = field(default_factory=no_readings)
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
            self.ranges,
            self.headings,
            self.anchors,
        )
        return not any(map(len, held))


def stream_of(t_ns: Array, values: Array, source: str, what: str, left_out: LeftOut) -> Stream:
    """Return the readings in order of time, one for each time. Count those whose time another has."""
    stream = make_stream(t_ns, values)
    left_out.add(source, f"{what} with the time of another", count=len(t_ns) - len(stream))
    return stream


def ranges_of(t_ns: Array, anchors: Sequence[str], range_m: Array, std_m: Array) -> Ranges:
    """Return the ranges in order of time."""
    order = np.argsort(t_ns, kind="stable")
    return Ranges(t_ns[order], tuple(anchors[i] for i in order.tolist()), range_m[order], std_m[order])


def headings_of(t_ns: Array, yaw_rad: Array, std_rad: Array) -> Headings:
    """Return the headings in order of time."""
    order = np.argsort(t_ns, kind="stable")
    return Headings(t_ns[order], yaw_rad[order], std_rad[order])

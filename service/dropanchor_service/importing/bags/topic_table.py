"""The messages of a topic as a table."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from dropanchor_service.importing.bags.bag import IMU, MAG, NS_PER_S, PRESSURE, RANGE, Bag, Message
from dropanchor_service.importing.progress import shown
from dropanchor_service.importing.readings import LeftOut
from dropanchor_service.importing.tables.flat import Flat, flat_rows
from dropanchor_service.importing.tables.table import Row

STAMP, STD = "stamp", "std"
_STAMPS = (
    ("header.stamp.sec", "header.stamp.nanosec"),
    ("timestamp.sec", "timestamp.nsec"),
    ("stamp.sec", "stamp.nanosec"),
)
_HIDDEN = ("covariance", "header.", "timestamp.sec", "timestamp.nsec", "stamp.sec", "stamp.nanosec", "__msgtype__")

_READINGS = {
    IMU: (STAMP, "linear_acceleration.", "angular_velocity."),
    MAG: (STAMP, "magnetic_field."),
    RANGE: (STAMP, STD, "range"),
    PRESSURE: (STAMP, "fluid_pressure"),
}


@dataclass(frozen=True)
class TopicTable:
    """name: of the topic. kind: type of its messages. count: of messages. columns: paths of the fields, and `stamp`:
    the time of the message in ns, or of its recording if it has none."""

    unit: ClassVar[str] = "message"
    name: str
    kind: str
    count: int
    columns: tuple[str, ...]
    bag: Bag
    notes: tuple[str, ...] = ()

    @property
    def anchor_advice(self) -> str:
        return f"--range {self.name}=ANCHOR names another one"

    def rows(self, left_out: LeftOut) -> Iterator[Row]:
        messages = shown(self.bag.messages([self.name]), self.name, self.count)
        for number, message in enumerate(messages, 1):
            if message.content is None:
                left_out.add(self.name, "damaged messages", number)
                continue
            for row in rows_of(message):
                if problem := _problem(row, self.kind):
                    left_out.add(self.name, problem, number)
                else:
                    yield number, [row.get(column) for column in self.columns]


def columns_of(messages: Sequence[Message], kind: str) -> tuple[str, ...]:
    """Return the columns of the messages of one topic. kind: of messages; of some, most fields are no readings."""
    names = dict.fromkeys(name for message in messages for row in rows_of(message) for name in row)
    used = _READINGS.get(kind, ("",))
    return tuple(name for name in names if name.startswith(used) and not any(hidden in name for hidden in _HIDDEN))


def rows_of(message: Message) -> Iterator[Flat]:
    """Yield the rows of a message, with its time."""
    for row in flat_rows(message.content):
        row[STAMP] = _stamp_ns(row) or message.t_ns
        variance = row.get("variance")
        if STD not in row and isinstance(variance, float) and variance > 0:
            row[STD] = math.sqrt(variance)
        yield row


def _stamp_ns(row: Flat) -> int:
    for sec, nsec in _STAMPS:
        whole, rest = row.get(sec), row.get(nsec)
        if isinstance(whole, int) and isinstance(rest, int):
            return whole * NS_PER_S + rest
    return 0


def _problem(row: Flat, kind: str) -> str:
    """Return why a message of ROS says itself that it holds nothing."""
    if kind == IMU:
        first: list[Any] = [row.get(f"{name}_covariance.0") for name in ("angular_velocity", "linear_acceleration")]
        return "messages without gyroscope or accelerometer" if -1.0 in first else ""
    if kind == RANGE:
        least, most, found = (row.get(name) for name in ("min_range", "max_range", "range"))
        if not isinstance(found, float) or not math.isfinite(found):
            return "ranges that are not finite"
        if isinstance(least, float) and isinstance(most, float) and most > least and not least <= found <= most:
            return "ranges outside min_range and max_range"
    return ""

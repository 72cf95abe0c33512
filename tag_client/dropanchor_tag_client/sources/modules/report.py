"""What a parser returns for the bytes of a module, and the reasons for leaving some of them out."""

from collections import Counter
from enum import StrEnum
from typing import NamedTuple, Protocol

from dropanchor_schemas.wire import Vector

MAX_RANGE_M = 1000.0  # these radios do not reach further


class Drop(StrEnum):
    """Reasons why data of a module were not used."""

    DAMAGED = "damaged"
    CHECKSUM = "checksum"
    TOO_LONG = "too_long"
    NOT_UNDERSTOOD = "not_understood"
    NO_ANSWER = "no_answer"
    NEGATIVE = "negative"
    ABSURD = "absurd"
    POSITION_ONLY = "position_only"
    UNCORRECTED = "uncorrected"
    ANCHOR_TO_ANCHOR = "anchor_to_anchor"
    OTHER_FRAME = "other_frame"


class Range(NamedTuple):
    """A range as the module reports it, m. tag: the id of the tag, where the module names it."""

    anchor: int | str
    range_m: float
    tag: str | None = None


class Imu(NamedTuple):
    """Axes of the module. acc: specific force, m/s². gyro: rad/s. tag: as for a range."""

    acc: Vector
    gyro: Vector
    tag: str | None = None


class Report(NamedTuple):
    """The content of one line or frame. device_ms: time on the module's own clock, if it sends it."""

    ranges: tuple[Range, ...]
    imu: Imu | None = None
    device_ms: int | None = None


class Parser(Protocol):
    """Parse bytes that arrive in pieces of any size. Never raises. Counts in `dropped` what it leaves out."""

    dropped: Counter[Drop]

    def feed(self, data: bytes) -> list[Report]: ...


def plausible(range_m: float, dropped: Counter[Drop]) -> bool:
    """Return whether a radio can have measured this range. Count it in `dropped` if not."""
    if 0.0 <= range_m <= MAX_RANGE_M:
        return True
    dropped[Drop.NEGATIVE if range_m < 0.0 else Drop.ABSURD] += 1
    return False

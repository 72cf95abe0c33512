"""What a parser returns for the bytes of a module, and the reasons for leaving some of them out."""

import math
from collections import Counter
from enum import StrEnum
from typing import NamedTuple, Protocol

from dropanchor_schemas.wire import Vector

MAX_RANGE_M = 1000.0  # these radios do not reach further
_MAX_DELAY_ERROR_M = 100.0  # what lies further below zero is no error of an antenna delay
_FAILED_MM = {32_767, 65_535, 327_670, 655_350}  # 7fff and ffff in mm and cm: a measurement that failed
_ACC_MAX, _GYRO_MAX, _MAG_MAX = 400.0, 100.0, 10_000.0  # m/s², rad/s, µT: more than a sensor can measure


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
    WITHOUT_RANGE = "without_range"
    REPEATED = "repeated"


class Dropped(Counter[Drop]):
    """Counts of what was left out, by reason. line: the last line that was not understood."""

    line: str = ""

    def not_understood(self, line: str) -> None:
        self[Drop.NOT_UNDERSTOOD] += 1
        self.line = line


class Range(NamedTuple):
    """A range as the module reports it, m. tag: the id of the tag, where the module names it. std_m: NaN if unknown.

    azimuth_rad: of what is named, seen from the module: 0 straight ahead, positive to the left; NaN: not measured.
    """

    anchor: int | str
    range_m: float
    tag: str | None = None
    std_m: float = math.nan
    azimuth_rad: float = math.nan


class Imu(NamedTuple):
    """Axes of the module. acc: specific force, m/s². gyro: rad/s. tag: as for a range. mag: µT."""

    acc: Vector
    gyro: Vector
    tag: str | None = None
    mag: Vector | None = None


class Report(NamedTuple):
    """The content of one line or frame. device_ns: time on the module's own clock, if it sends it."""

    ranges: tuple[Range, ...]
    imu: Imu | None = None
    device_ns: int | None = None


class Parser(Protocol):
    """Parse bytes that arrive in pieces of any size. Never raises. Counts in `dropped` what it leaves out."""

    dropped: Dropped

    def feed(self, data: bytes) -> list[Report]: ...


def plausible(range_m: float, dropped: Counter[Drop]) -> bool:
    """Return whether a radio can have measured this range. Count it in `dropped` if not."""
    if 0.0 <= range_m <= MAX_RANGE_M and round(1000 * range_m) not in _FAILED_MM:
        return True
    dropped[Drop.NEGATIVE if -_MAX_DELAY_ERROR_M < range_m < 0.0 else Drop.ABSURD] += 1
    return False


def plausible_imu(imu: Imu, dropped: Counter[Drop]) -> bool:
    """Return whether an IMU can have measured this. Count it in `dropped` if not."""
    limits = ((imu.acc, _ACC_MAX), (imu.gyro, _GYRO_MAX), (imu.mag or (), _MAG_MAX))
    if all(abs(value) <= limit for values, limit in limits for value in values):
        return True
    dropped[Drop.ABSURD] += 1
    return False

"""What is wrong with the sensors of a tag, in a word and in a sentence that says what to do."""

import math
from enum import IntEnum
from typing import NamedTuple

from dropanchor_service.estimation.columns import Array


class ImuVerdict(IntEnum):
    """What is wrong with an IMU. GOOD: nothing that shows."""

    GOOD = 0
    ACC_IN_G = 1
    ACC_IN_MG = 2
    ACC_SCALE = 3
    ACC_NO_GRAVITY = 4
    ACC_SILENT = 5
    ACC_STUCK = 6
    ACC_REVERSED = 7
    GYRO_IN_DEG = 8
    GYRO_STUCK = 9
    AXES_DIFFER = 10
    TURNS_DIFFER = 11
    RAW_COUNTS = 12
    # from here on doubts: the samples are used, but the track is not believed
    UPSIDE_DOWN = 13
    TURNS_DOUBTED = 14
    AXES_DOUBTED = 15


class RangeVerdict(IntEnum):
    """What is wrong with the ranges of a tag. GOOD: nothing that shows."""

    GOOD = 0
    IN_MM = 1
    IN_CM = 2
    AVERAGED = 3


class Finding(NamedTuple):
    """One fault. name: for machines. sentence: what it is and what to do. setting: of the tag, and the value that
    mends it; None where no setting does. number: the number or axis in the sentence; None: it has none."""

    name: str
    sentence: str
    setting: tuple[str, str | bool] | None = None
    number: str | None = None


_AXIS = "xyz"
_WAY_OUT: dict[ImuVerdict, tuple[str, str | bool]] = {
    ImuVerdict.ACC_IN_G: ("acc_unit", "g"),
    ImuVerdict.ACC_IN_MG: ("acc_unit", "mg"),
    ImuVerdict.ACC_REVERSED: ("acc_reversed", True),
    ImuVerdict.GYRO_IN_DEG: ("gyro_unit", "deg/s"),
}
_RANGE_WAY_OUT: dict[RangeVerdict, tuple[str, str | bool]] = {
    RangeVerdict.IN_MM: ("range_unit", "mm"),
    RangeVerdict.IN_CM: ("range_unit", "cm"),
}
_IN_ONE_ORDER = "send the axes of both in one order and with the right signs (x forward, y left, z up)."
IMU_SENTENCES = {
    ImuVerdict.ACC_IN_G: "The accelerations look like g, not m/s²: multiply them by 9.80665, or set `acc_unit` to g.",
    ImuVerdict.ACC_IN_MG: "The accelerations look like thousandths of g, not m/s²: multiply them by 0.00980665, or "
    "set `acc_unit` to mg.",
    ImuVerdict.ACC_SCALE: "The accelerations are {number} m/s² on average, and gravity is 9.8: check their unit and "
    "scale.",
    ImuVerdict.ACC_NO_GRAVITY: "Gravity is missing from the accelerations: send what the sensor measures (total "
    "acceleration), not linear acceleration.",
    ImuVerdict.ACC_SILENT: "The accelerometer is silent, all its values are 0: check its wiring and its driver.",
    ImuVerdict.ACC_STUCK: "The accelerometer repeats one value while the gyroscope goes on: check its driver.",
    ImuVerdict.ACC_REVERSED: "The accelerations have the opposite sign, as on iOS: a tag that lies still must show "
    "+9.8 m/s² along the axis that points up. Reverse them or set `acc_reversed`; if the tag hangs upside down, set "
    "it to false.",
    ImuVerdict.UPSIDE_DOWN: "The tag hangs upside down, or its accelerations have the opposite sign, as on iOS: set "
    "`acc_reversed` to false or to true, or turn left and right a few times.",
    ImuVerdict.GYRO_IN_DEG: "The rates of turn look like °/s, not rad/s: multiply them by 0.0174533, or set "
    "`gyro_unit` to deg/s.",
    ImuVerdict.GYRO_STUCK: "The gyroscope repeats one value while the tag moves: check its driver.",
    ImuVerdict.AXES_DIFFER: "The gyroscope turns about its {number} axis, but gravity does not follow: "
    + _IN_ONE_ORDER,
    ImuVerdict.TURNS_DIFFER: f"The gyroscope and the magnetometer turn in different ways: {_IN_ONE_ORDER}",
    ImuVerdict.TURNS_DOUBTED: f"The gyroscope and the magnetometer seem to turn in different ways: {_IN_ONE_ORDER}",
    ImuVerdict.AXES_DOUBTED: f"The gyroscope turns about an axis that gravity does not follow: {_IN_ONE_ORDER}",
    ImuVerdict.RAW_COUNTS: "The IMU's values are beyond what such sensors measure ({number} along one axis): they look "
    "like raw counts, so multiply them by the scale of the data sheet (m/s², rad/s, µT).",
}
RANGE_SENTENCES = {
    RangeVerdict.IN_MM: "The ranges look like millimetres: divide them by 1000, or set `range_unit` to mm.",
    RangeVerdict.IN_CM: "The ranges look like centimetres: divide them by 100, or set `range_unit` to cm.",
    RangeVerdict.AVERAGED: "The module averages about {number} ranges, so that their errors last: switch its "
    "filter off.",
}
SENTENCES = {verdict.name.lower(): text for verdict, text in IMU_SENTENCES.items()} | {
    f"range_{verdict.name.lower()}": text for verdict, text in RANGE_SENTENCES.items()
}
"""The sentence of every finding, by its name; {number} stands for a number or an axis."""


VIGOROUS = Finding(
    "vigorous_motion", "Vigorous motion, as when a compass is calibrated: units and axes are not judged in it."
)
"""Said of a recording alone: nothing is wrong."""


def findings(check: Array) -> list[Finding]:
    """Return what is wrong with a tag. check: CHECK (0-d)."""
    found = []
    imu, ranges = ImuVerdict(int(check["imu_verdict"])), RangeVerdict(int(check["range_verdict"]))
    if imu:
        found.append(_finding(imu.name.lower(), _detail_of(imu, float(check["imu_detail"])), _WAY_OUT.get(imu)))
    if ranges:
        number = f"{float(check['range_detail']):.0f}"
        found.append(_finding(f"range_{ranges.name.lower()}", number, _RANGE_WAY_OUT.get(ranges)))
    return found


def _finding(name: str, number: str, setting: tuple[str, str | bool] | None) -> Finding:
    text = SENTENCES[name]
    return Finding(name, text.format(number=number), setting, number if "{number}" in text else None)


def _detail_of(verdict: ImuVerdict, detail: float) -> str:
    if verdict == ImuVerdict.AXES_DIFFER:
        return _AXIS[int(detail)]
    if math.isnan(detail):
        return "?"
    return f"{detail:.1f}" if detail < 100 else f"{detail:.0f}"

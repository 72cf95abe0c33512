"""The fields of a pattern, and their units."""

import math
from collections.abc import Iterable
from typing import NamedTuple

_LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}
_ANGLES = {"deg": math.pi / 180, "rad": 1.0, "-deg": -math.pi / 180, "-rad": -1.0}
_TIMES = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}
_ACC = {"m/s2": 1.0, "g": 9.80665, "mg": 9.80665e-3}
_GYRO = {"rad/s": 1.0, "deg/s": math.pi / 180, "mdeg/s": math.pi / 180_000}
_MAG = {"uT": 1.0, "nT": 0.001, "G": 100.0, "mG": 0.1}

ACC, GYRO, MAG = ("ax", "ay", "az"), ("gx", "gy", "gz"), ("mx", "my", "mz")
NAMES = ("anchor", "tag")
ANYTHING = "_"
NUMBERS = {
    "range": _LENGTHS,
    "std": _LENGTHS,
    "azimuth": _ANGLES,
    "ahead": _LENGTHS,
    "right": _LENGTHS,
    "merit": {"%": 1.0},
    "t": _TIMES,
    **dict.fromkeys(ACC, _ACC),
    **dict.fromkeys(GYRO, _GYRO),
    **dict.fromkeys(MAG, _MAG),
}
"""The factor of each unit, to SI, µT and ns, by the field that may have it.

azimuth: positive to the left, with -deg to the right. ahead, right: where what is named lies, as the module sees it.
merit: of the azimuth, which says nothing where this is 0.
"""


class PatternError(ValueError):
    """A pattern is wrong. The message shows the place."""

    def __init__(self, problem: str, pattern: str, at: int) -> None:
        super().__init__(f"{problem}\n  {pattern}\n  {' ' * at}^")


class Field(NamedTuple):
    """A field of a pattern. scale: of a number, to the unit of the report. base: of a name that is a number in text."""

    name: str
    scale: float = 1.0
    base: int | None = None


def field(text: str, pattern: str, at: int) -> Field:
    """Return the field `name` or `name:unit`, which stands at this place of the pattern. Raises PatternError."""
    name, colon, unit = (part.strip() for part in text.partition(":"))
    if name in NUMBERS:
        return Field(name, _scale(name, unit, pattern, at))
    if name not in (*NAMES, ANYTHING):
        known = ", ".join([*NAMES, *NUMBERS, ANYTHING])
        raise PatternError(f'there is no field "{name}"; known are {known}', pattern, at)
    if not colon:
        return Field(name)
    if name in NAMES and unit == "hex":
        return Field(name, base=16)
    allowed = ", or :hex for a number in hexadecimal" if name in NAMES else ""
    raise PatternError(f'"{name}" has no unit "{unit}": it stands alone{allowed}', pattern, at)


def _scale(name: str, unit: str, pattern: str, at: int) -> float:
    units = NUMBERS[name]
    if unit not in units:
        problem = f'"{name}" has no unit "{unit}"' if unit else f'"{name}" needs its unit'
        raise PatternError(f"{problem}: {', '.join(f'{name}:{known}' for known in units)}", pattern, at)
    return units[unit]


def check_complete(names: Iterable[str], pattern: str) -> None:
    """Raise PatternError unless the fields make a range or a sample of an IMU."""
    given = [name for name in names if name != ANYTHING]
    for name in given:
        if given.count(name) > 1:
            raise PatternError(f'"{name}" is there twice', pattern, 0)
    imu = [axis for axis in (*ACC, *GYRO, *MAG) if axis in given]
    needed = {*ACC, *GYRO, *(MAG if set(MAG) & set(imu) else ())}
    if imu and needed - set(imu):
        raise PatternError(f"an IMU sample needs {', '.join(sorted(needed - set(imu)))}, too", pattern, 0)
    if not imu and "range" not in given:
        raise PatternError("nothing here is a range: {range:m}, or another unit", pattern, 0)

"""Turn what a pattern found in a line into a report."""

import math
from collections.abc import Mapping
from typing import Any

from dropanchor_schemas.wire import Vector
from dropanchor_tag_client.sources.modules.patterns.fields import ACC, GYRO, MAG, Field
from dropanchor_tag_client.sources.modules.report import (
    Drop,
    Dropped,
    Imu,
    Range,
    Report,
    plausible,
    plausible_imu,
)

Found = Mapping[str, Any]
"""What stands in the place of each field: a text, or a value of JSON. A field may be missing."""

_ONLY_ANCHOR = 0  # the name of the anchor where a pattern has none
_MAX_NAME, _MAX_NUMBER = 64, 2**32


def report(fields: Mapping[str, Field], found: list[Found], dropped: Dropped) -> Report:
    """Return the report of a line. Count in `dropped` what cannot be used."""
    ranges = [_range(fields, one, dropped) for one in found] if "range" in fields else []
    imu = _imu(fields, found[0], dropped) if found and ACC[0] in fields else None
    time_ns = _number(fields["t"], found[0].get("t")) if found and "t" in fields else None
    is_time = time_ns is not None and math.isfinite(time_ns)
    return Report(tuple(one for one in ranges if one is not None), imu, round(time_ns) if is_time and time_ns else None)


def _range(fields: Mapping[str, Field], found: Found, dropped: Dropped) -> Range | None:
    if found.get("range") is None:
        dropped[Drop.NO_ANSWER] += 1
        return None
    range_m = _number(fields["range"], found["range"])
    anchor = _name(fields["anchor"], found.get("anchor")) if "anchor" in fields else _ONLY_ANCHOR
    tag = _name(fields["tag"], found.get("tag")) if "tag" in fields else None
    if range_m is None or anchor is None or ("tag" in fields and tag is None):
        dropped[Drop.DAMAGED] += 1
        return None
    if range_m == 0.0:  # what drivers write when a measurement failed
        dropped[Drop.NO_ANSWER] += 1
        return None
    std_m = _number(fields["std"], found.get("std")) if "std" in fields else None
    good_std = std_m is not None and math.isfinite(std_m) and std_m > 0.0
    text = None if tag is None else str(tag)
    std = std_m if good_std and std_m else math.nan
    made = Range(anchor, range_m, text, std, _azimuth(fields, found))
    return made if plausible(range_m, dropped) else None


def _azimuth(fields: Mapping[str, Field], found: Found) -> float:
    """Return the azimuth of a measurement, rad to the left of straight ahead; NaN without one."""

    def told(name: str) -> float:
        value = _number(fields[name], found.get(name)) if name in fields else None
        return math.nan if value is None else value

    if told("merit") == 0.0:
        return math.nan
    ahead, right, azimuth = told("ahead"), told("right"), told("azimuth")
    if "azimuth" in fields:
        return math.remainder(azimuth, math.tau) if math.isfinite(azimuth) else math.nan
    is_place = math.isfinite(ahead + right) and (ahead, right) != (0.0, 0.0)
    return math.atan2(-right, ahead) if is_place else math.nan


def _imu(fields: Mapping[str, Field], found: Found, dropped: Dropped) -> Imu | None:
    acc, gyro = _vector(fields, found, ACC), _vector(fields, found, GYRO)
    mag = _vector(fields, found, MAG) if MAG[0] in fields else None
    tag = _name(fields["tag"], found.get("tag")) if "tag" in fields else None
    if acc is None or gyro is None or (MAG[0] in fields and mag is None):
        dropped[Drop.DAMAGED] += 1
        return None
    imu = Imu(acc, gyro, None if tag is None else str(tag), mag)
    return imu if plausible_imu(imu, dropped) else None


def _vector(fields: Mapping[str, Field], found: Found, names: tuple[str, str, str]) -> Vector | None:
    x, y, z = (_number(fields[name], found.get(name)) for name in names)
    return None if x is None or y is None or z is None else (x, y, z)


def _number(field: Field, value: Any) -> float | None:
    """Return the value in the unit of the report, NaN for what is no number but stands for one; None if damaged."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        return field.scale * float(value)
    except OverflowError:
        return math.inf
    except ValueError:
        return math.nan if str(value).strip().lower() == "ovf" else None


def _name(field: Field, value: Any) -> int | str | None:
    """Return a name: a number as a number, a text as the module prints it; None if it is neither."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int | str):
        return None
    if field.base is not None:
        try:
            value = int(str(value), field.base)
        except ValueError:
            return None
    if isinstance(value, int):
        return value if 0 <= value < _MAX_NUMBER else f"{value:X}"[:_MAX_NAME]
    return value.strip() if value.strip() and len(value) <= _MAX_NAME else None

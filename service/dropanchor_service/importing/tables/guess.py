"""Guess from the names of columns what they hold: `acc_x [g]`, `gyro_x_dps`, `distance_mm`, `linear_acceleration.x`."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from dropanchor_service.importing.readings import ACC, GYRO, HEADING, MAG, PRESSURE, RANGE, TRUTH, ImportingError
from dropanchor_service.importing.tables.mapping import (
    ANCHOR,
    OPTIONAL,
    POSITION,
    T_NSEC,
    VECTORS,
    WIDE,
    Column,
    T,
    quantity_of,
)
from dropanchor_service.importing.tables.units import SI, known

_SENSORS = {
    ACC: {"a", "acc", "accel", "accelerometer", "acceleration", "accelerations", "accelero", "lsm6acc", "force", "ac"},
    GYRO: {"g", "w", "gyr", "gy", "gyro", "gyros", "gyroscope", "omega", "angular", "rotation", "rot"},
    MAG: {"m", "mag", "magn", "magnet", "magnetometer", "magnetic", "b", "compass"},
}
_WITHOUT_GRAVITY = {"linear", "lin", "user", "free", "world", "filtered", "raw"}  # used where there is nothing else
_NOT_A_READING = {"cov", "covariance", "std", "stddev", "sigma", "bias", "offset", "var", "variance", "gravity", "quat"}
_NOT_A_READING |= {
    "orientation",
    "quaternion",
    "position",
    "pos",
    "truth",
    "gt",
    "temp",
    "temperature",
    "error",
    "jerk",
}
_AXES = {"x": 0, "y": 1, "z": 2, "0": 0, "1": 1, "2": 2}
_STUCK = re.compile(r"(?:(?P<sensor>[a-z]+?)(?P<axis>[xyz])|(?P<axis2>[xyz])(?P<sensor2>[a-z]{3,}))")
_TIMES = {"t", "time", "times", "timestamp", "timestamps", "ts", "stamp", "date", "datetime", "tick", "ticks", "epoch"}
_TIMES_WITH_UNIT = {
    "millis": "ms",
    "micros": "us",
    "nanos": "ns",
    "seconds": "s",
    "secs": "s",
    "sec": "s",
    "elapsed": "",
}
_OF_TIMES = {"header", "field", "unix", "utc", "sensor", "system", "sys", "device", "host", "since", "start", "boot"}
_OF_TIMES |= {"log", "elapsed", "local", "gps", "imu", "uwb", "recv", "received", "sample", "of", "iso", "monotonic"}
_OF_TIMES |= {"day", "in", "fine", "utctime", "logging"}
_NANOSECONDS = {"nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds"}
_RANGES = {"range", "ranges", "dist", "distance", "distances", "d", "r", "uwb", "tof", "twr", "measured", "measurement"}
_RANGES |= {"rng", "slant", "ranging", "value"}
_RANGE_NAMES = _RANGES - {"uwb", "tof", "twr", "measured", "measurement", "slant", "value"}
_NOT_A_RANGE = _NOT_A_READING | {"rssi", "quality", "max", "min", "fov", "view", "snr", "count", "seq", "status", "id"}
_ANCHORS = {"anchor", "anchors", "anchorid", "beacon", "beaconid", "anc", "responder", "node", "nodeid"}
_IDS = {"id", "mac", "addr", "address"}  # of the anchor, beside a range
_OF_ANCHORS = {"id", "addr", "address", "mac", "name", "short", "device", "range", "ranges", "uwb", "to", "from"}
_STDS = {"std", "stddev", "sigma", "stdev", "uncertainty"}
_HEADINGS = {"heading", "yaw"}
_PRESSURES = {"pressure", "press", "barometer", "baro", "barometric", "air", "fluid"}
_PRESSURE_NAMES = {"pressure", "press", "baro", "barometer"}
_TRUTHS = {"truth", "groundtruth", "gt", "mocap", "vicon", "optitrack"}
_OF_TRUTHS = _TRUTHS | {"ground", "position", "pos", "pose", "p", "t", "translation", "true", *_HEADINGS}
_BARE = {"vector", "value", "values", "data", "xyz"}
_BRACKETS = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|°/?s?")
_ROSTOPIC = "field."  # rostopic echo -p puts it before each name
_OF_APPLE = "accelerometerAcceleration"  # of SensorLog: as iPhones give it, -1 upwards at rest
_TEMPERATURE = re.compile(r"°|(?:°|deg)? ?[CFK]", re.IGNORECASE)
_G_FORCE = re.compile(r"^g[ _-]?f(?:orce)?[ _-]?[xyz]$", re.IGNORECASE)
_UNITS_OF_SENSORS = {
    GYRO: re.compile(r".*(?:/s|s-1|s\^-1|dps)"),
    MAG: re.compile(r"[unmµμ]?T|m?gauss", re.IGNORECASE),
    ACC: re.compile(r"m?g|.*/s(?:2|²|\^2)", re.IGNORECASE),
}


class _Found(NamedTuple):
    """field: of the mapping. unit: as the name tells it. rank: the smaller, the better. sign: as of a column."""

    field: str
    unit: str | None
    rank: int
    sign: int = 1


def guessed(columns: Sequence[str], table: str = "") -> dict[str, Column]:
    """Return the columns by field. Raises ImportingError for a reading with a unit that is not known.

    table: its name, which tells what columns are that are only named x, y and z.
    """
    best: dict[str, tuple[int, Column]] = {}
    of_truth = bool(_TRUTHS & set(words_of_name(table)))
    for name in columns:
        found = _found(name, of_truth) or _of_table(table, name)
        if found and (found.field not in best or found.rank < best[found.field][0]):
            best[found.field] = found.rank, Column(name, found.unit, found.sign)
    fields = {field: column for field, (_, column) in best.items()}
    if T_NSEC in fields and T not in fields:
        fields[T] = Column(fields.pop(T_NSEC).name, "ns")
    if {"x", "y"} <= {name.lower() for name in columns}:  # of a truth: its heading was not measured by the tag
        fields = {field: column for field, column in fields.items() if field not in (HEADING, "heading_std")}
    if RANGE in fields and ANCHOR not in fields and (names := [name for name in columns if name.lower() in _IDS]):
        fields[ANCHOR] = Column(names[0])
    if RANGE in fields or ANCHOR in fields:
        fields = {field: column for field, column in fields.items() if not field.startswith(WIDE)}
    return whole(fields)


def whole(fields: Mapping[str, Column]) -> dict[str, Column]:
    """Return the fields that are of use, in their usual order."""
    return {field: fields[field] for field in sorted(fields, key=_order) if _is_whole(field, fields)}


def is_anchors(columns: Sequence[str]) -> bool:
    """Return whether a table holds the positions of anchors."""
    names = {name.strip().lower() for name in columns}
    return {"x", "y"} <= names and bool(names & {"id", "anchor", "anchor_id", "name"}) and T not in guessed(columns)


def position_columns(columns: Sequence[str]) -> dict[str, Column]:
    """Return the columns of a table of anchors by `POSITION`. z may lack."""
    names = {name.strip().lower(): name for name in columns}
    identifier = next(names[name] for name in ("id", "anchor_id", "anchor", "name") if name in names)
    return {"id": Column(identifier)} | {axis: Column(names[axis]) for axis in POSITION[1:] if axis in names}


def _is_whole(field: str, fields: Mapping[str, Column]) -> bool:
    """Return whether the field is of use: a vector needs its three axes, a deviation its value."""
    vector = next((names for name, names in VECTORS.items() if field in (*names, *OPTIONAL.get(name, ()))), ())
    if field == "heading_std":
        return HEADING in fields
    return all(name in fields for name in vector)


def _order(field: str) -> int:
    order = (T, T_NSEC, *(name for names in VECTORS.values() for name in names), ANCHOR, RANGE)
    return order.index(field) if field in order else len(order)


def _found(name: str, of_truth: bool) -> _Found | None:
    """Return what a column holds, with the unit in brackets or at the end of its name. of_truth: its table is one."""
    name = name.removeprefix(_ROSTOPIC)
    bracketed = _BRACKETS.match(name)
    if bracketed and bracketed[1] and not bracketed[2].isdigit():
        words = words_of_name(bracketed[1])
        found = _identified(words, of_truth) or _by_unit(words, bracketed[2])
        if found and name.startswith(_OF_APPLE):
            found = found._replace(sign=-1)
        return found and _with_unit(found, bracketed[2], name)
    words = words_of_name(name)
    if _G_FORCE.search(name) and words[-1][-1] in _AXES:  # always with gravity, where others beside it may lack it
        return _Found(VECTORS[ACC][_AXES[words[-1][-1]]], "g", -1)
    if _NANOSECONDS & set(words):
        return _time(words)
    for count in (3, 2, 1):  # words of a unit at the end, as in gyro_x_rad_s
        unit = "".join(words[-count:])
        found = _identified(words[:-count], of_truth) if len(words) > count else None
        quantity = quantity_of(found.field) if found else None
        if found and quantity and not found.unit and known(unit, quantity):
            return found._replace(unit=unit)
    return _identified(words, of_truth)


def _by_unit(words: list[str], unit: str) -> _Found | None:
    """Return the axis of a sensor that only its unit tells, as `AsX(°/s)` and `HX(uT)`."""
    of_sensor = (quantity for quantity, units in _UNITS_OF_SENSORS.items() if units.fullmatch(unit))
    quantity = next(of_sensor, None) if known(unit, MAG) or known(unit, ACC) or known(unit, GYRO) else None
    words = words[:1] if words[1:] == ["axis"] else words  # of MetaWear: x-axis (g)
    axis = words[-1][-1] if words and not _NOT_A_READING & set(words) else ""
    if quantity is None or axis not in "xyz" or not axis:
        return None
    return _Found(VECTORS[quantity]["xyz".index(axis)], None, 5)


def _of_table(table: str, name: str) -> _Found | None:
    """Return what a column holds that names only an axis, by the name of its table."""
    words = words_of_name(_BRACKETS.sub(r"\1", name))
    bare = bool(words) and words[-1] in _AXES and set(words[:-1]) <= _BARE
    return _vector([*(word for word in words_of_name(table) if len(word) > 2), words[-1]]) if bare else None


def _with_unit(found: _Found, unit: str, name: str) -> _Found | None:
    quantity = quantity_of(found.field)
    if quantity is None or not unit:
        return found
    if known(unit, quantity) is None and found.field == T:
        return None if _TEMPERATURE.fullmatch(unit) else found  # loggingTime(txt) is ISO 8601
    if known(unit, quantity) is None:
        raise ImportingError(
            f"the column {name!r} has the unit {unit!r}, which is not known: say with --map what it is, as "
            f"'{found.field}={name}:{SI[quantity]}', or '…:{SI[quantity]}/1000' for counts"
        )
    return found._replace(unit=unit)


def words_of_name(name: str) -> list[str]:
    """Return the words of the name of a column, in lower case."""
    return [word.lower() for word in _WORDS.findall(name.replace("°/s", " dps ").replace("µ", "u"))]


def _identified(words: list[str], of_truth: bool) -> _Found | None:
    return _true(words, of_truth) or _vector(words) or _time(words) or _scalar(words) or _wide(words)


def _vector(words: list[str]) -> _Found | None:
    if not words or _NOT_A_READING & set(words):
        return None
    sensors, axis = set(words[:-1]), words[-1]
    if len(words) > 1 and words[0] in "xyz" and axis not in _AXES:
        sensors, axis = set(words[1:]), words[0]
    stuck = _STUCK.fullmatch(words[-1])
    if axis not in _AXES and stuck:
        sensors, axis = {stuck["sensor"] or stuck["sensor2"]}, stuck["axis"] or stuck["axis2"]
    for quantity, known_words in _SENSORS.items():
        certain = sensors & known_words if axis in "xyz" else sensors & known_words - set("agwmb")
        if axis in _AXES and certain:
            rank = len(words) + 10 * len(_WITHOUT_GRAVITY & set(words))
            return _Found(VECTORS[quantity][_AXES[axis]], None, rank)
    return None


def _true(words: list[str], of_truth: bool) -> _Found | None:
    """Return the field of a true place: `gt_x`, or in a table of them `x`, `tx`, `position.x`, `yaw`."""
    *rest, last = ["".join(words)[:1], words[0][1:]] if len(words) == 1 and words[0][1:] in _AXES else words or [""]
    of_truth |= bool(_TRUTHS & set(rest))
    if not of_truth or not set(rest) <= _OF_TRUTHS or (last not in "xyz" and last not in _HEADINGS) or not last:
        return None
    return _Found(f"{TRUTH}_{'yaw' if last in _HEADINGS else last}", None, len(words))


def _time(words: list[str]) -> _Found | None:
    found = set(words)
    if found & _NANOSECONDS and found <= _NANOSECONDS | _OF_TIMES | _TIMES:
        return _Found(T_NSEC, None, len(words))
    unit = next((_TIMES_WITH_UNIT[word] for word in words if word in _TIMES_WITH_UNIT), None)
    if (unit is None and not found & _TIMES) or not found <= _TIMES | set(_TIMES_WITH_UNIT) | _OF_TIMES:
        return None
    if {"sample", "fine"} <= found:  # of Xsens, in steps of 0.1 ms
        unit = "us*100"
    return _Found(T, unit or None, len(words) + 10 * ("elapsed" in found))


def _scalar(words: list[str]) -> _Found | None:
    found = set(words)
    if not found:
        return None
    if found & _STDS and found <= _STDS | _RANGES | _HEADINGS:
        return _Found("heading_std" if found & _HEADINGS else "std", None, len(words))
    if found & _ANCHORS and found <= _ANCHORS | _OF_ANCHORS:
        return _Found(ANCHOR, None, len(words))
    if found & _HEADINGS and len(found) == 1:
        return _Found(HEADING, None, len(words))
    if found & _PRESSURE_NAMES and found <= _PRESSURES:
        return _Found(PRESSURE, None, len(words))
    if found & _RANGE_NAMES and found <= _RANGES:
        return _Found(RANGE, None, len(words))
    return None


def _wide(words: list[str]) -> _Found | None:
    """Return the ranges to one anchor, whose id the name holds: `dist_A1`, `range to anchor 3`."""
    found = set(words)
    rest = [word for word in words if word not in _RANGES | _ANCHORS | {"to", "from"}]
    if not found & _RANGE_NAMES or found & _NOT_A_RANGE or not 1 <= len(rest) <= 2:
        return None
    return _Found(WIDE + "".join(rest).upper(), None, len(words))


def unused(columns: Iterable[str], fields: dict[str, Column]) -> list[str]:
    """Return the columns that no field uses."""
    used = {column.name for column in fields.values()}
    return [column for column in columns if column and column not in used]

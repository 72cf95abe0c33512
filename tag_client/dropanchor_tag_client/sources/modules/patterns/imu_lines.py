"""Suggest a pattern for a line with the axes of an IMU, with names before them or as bare columns."""

import math
import re
from collections.abc import Iterator

from dropanchor_tag_client.sources.modules.patterns.fields import ACC, GYRO, MAG

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_NAMED = re.compile(rf"(?P<name>[A-Za-z]+(?:[ _.][XYZxyz])?)\W{{0,2}}?[:= ,\t]{{1,2}}(?P<number>{_NUMBER.pattern})")
_SENSORS = ((ACC, r"a|ac|acc|accel|accelerometer"), (GYRO, r"g|gy|gyr|gyro|w|rot"), (MAG, r"m|mag|magn"))
_COUNTS = {6: (*ACC, *GYRO), 7: (*ACC, *GYRO), 9: (*ACC, *GYRO, *MAG), 10: (*ACC, *GYRO, *MAG)}
_GRAVITY = (("m/s2", 9.8), ("g", 1.0), ("mg", 1000.0))
_SLACK = 1.25
_WORDS = {"acc", "accel", "acceleration", "accelerometer", "gyr", "gyro", "gyroscope", "mag", "imu", "x", "y", "z"} | {
    "deg",
    "dps",
    "rad",
    "s",
}


def imu_patterns(line: str) -> Iterator[str]:
    """Yield the patterns that the line may mean. Units are guessed: gravity tells that of the accelerations."""
    named = {axis: found.span("number") for found in _NAMED.finditer(line) if (axis := _axis(found["name"]))}
    if {*ACC, *GYRO} <= set(named):
        yield from _written(
            line, {axis: span for axis, span in named.items() if axis not in MAG or set(MAG) <= set(named)}
        )
    spans = [found.span() for found in _NUMBER.finditer(line)]
    words = [word.lower() for word in re.findall("[A-Za-z]+", _NUMBER.sub("", line))]
    if set(words) <= _WORDS and _is_acc_first(words) and (axes := _COUNTS.get(len(spans))):
        for first in reversed(range(len(spans) - len(axes) + 1)):  # a time stands before them
            yield from _written(line, dict(zip(axes, spans[first:], strict=False)))


def _is_acc_first(words: list[str]) -> bool:
    """Return whether the words, if there are any, name accelerations and then turn rates."""
    kinds = [word[0] for word in words if word[0] in "ag"]
    return not words or kinds == ["a", "g"]


def _axis(name: str) -> str | None:
    for axes, words in _SENSORS:
        found = re.fullmatch(rf"(?:{words})[ _.]?(?P<axis>[xyz])", name, re.IGNORECASE)
        if found:
            return axes["xyz".index(found["axis"].lower())]
    return None


def _written(line: str, spans: dict[str, tuple[int, int]]) -> Iterator[str]:
    force = math.hypot(*(float(line[slice(*spans[axis])]) for axis in ACC))
    unit = next((name for name, gravity in _GRAVITY if gravity / _SLACK < force < gravity * _SLACK), None)
    if unit is None:
        return
    turn = "rad/s" if "rad" in line or (unit == "m/s2" and re.search("deg|dps|°", line) is None) else "deg/s"
    units = dict.fromkeys(ACC, unit) | dict.fromkeys(GYRO, turn) | dict.fromkeys(MAG, "uT")
    text, at = "", 0
    for axis, (begin, end) in sorted(spans.items(), key=lambda one: one[1]):
        text += _general(line[at:begin]) + f"{{{axis}:{units[axis]}}}"
        at = end
    yield text


def _general(text: str) -> str:
    return _NUMBER.sub("{_}", text.replace("{", "{{").replace("}", "}}"))

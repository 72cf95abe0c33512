"""How many dashes an SVG draws at most. A browser draws each for itself: a line of a few bytes can have a million."""

import re
from xml.etree.ElementTree import Element

DASHES = "stroke-dasharray"
MOST_DASHES = 1_000_000
"""Of one path. Skia, which draws for Chromium, gives up on more (`kMaxDashCount` in SkDashPath.cpp)."""

_ENDLESS = 1e12
_NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_PLAIN = re.compile(r"(?:[-+0-9.eE,\s]|px|mm|cm|in|pt|pc)*")
_POINTS = ("d", "points")
_SIZES = ("x1", "x2", "y1", "y2", "width", "height", "r", "rx", "ry", "pathLength")
_PER_SIZE = 7  # the length of a circle is less than that many radii


def length_of(element: Element) -> float:
    """Return how long the outline of an element is at most, in its own units."""
    length = sum(2 * _sum(element.get(name, "")) for name in _POINTS)
    sizes = [element.get(name, "") for name in _SIZES]
    length += sum(_PER_SIZE * _sum(size) if _PLAIN.fullmatch(size) else _ENDLESS for size in sizes)
    return min(length, _ENDLESS)


def dashes_of(value: str, length: float) -> float:
    """Return how many dashes of this pattern fit into a length."""
    if value.strip() in ("none", "inherit", "initial", "unset"):
        return 0.0
    if not _PLAIN.fullmatch(value):  # a unit that depends on something else
        return _ENDLESS
    period = _sum(value)
    return length / period if period > 0 else 0.0  # without a period the line is whole


def _sum(text: str) -> float:
    """Return the sum of the numbers in a text without their signs."""
    return min(sum(map(float, _NUMBER.findall(text))), _ENDLESS) if text else 0.0

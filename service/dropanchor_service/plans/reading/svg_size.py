"""The size of an SVG in pixels. An SVG has no pixels of its own, so its longer side always gets as many."""

import math
import re
from xml.etree import ElementTree

from dropanchor_schemas.sentences import say
from dropanchor_service.plans.reading.refused import RefusedError

LONGER_SIDE_PX = 2000

_LENGTH = re.compile(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(px|mm|cm|in|pt|pc)?\s*")
_PER_UNIT = {"": 1.0, "px": 1.0, "mm": 96 / 25.4, "cm": 96 / 2.54, "in": 96.0, "pt": 96 / 72, "pc": 16.0}


def size_of(root: ElementTree.Element) -> tuple[int, int]:
    """Return width and height, and write them into the root. Raises RefusedError."""
    box = _view_box(root)
    width, height = _length(root.get("width")), _length(root.get("height"))
    if width is None or height is None:
        if box is None:
            raise RefusedError(say("svg_size", "the SVG has neither a viewBox nor a width and a height"))
        width, height = box[2:]
    if box is None:
        root.set("viewBox", f"0 0 {width:g} {height:g}")
    scale = LONGER_SIDE_PX / max(width, height)
    pixels = max(1, round(width * scale)), max(1, round(height * scale))
    root.set("width", str(pixels[0]))
    root.set("height", str(pixels[1]))
    return pixels


def _view_box(root: ElementTree.Element) -> list[float] | None:
    try:
        numbers = [float(number) for number in re.split(r"[\s,]+", root.get("viewBox", "").strip())]
    except ValueError:
        return None
    is_box = len(numbers) == 4 and all(map(math.isfinite, numbers)) and min(numbers[2:]) > 0
    return numbers if is_box else None


def _length(text: str | None) -> float | None:
    found = _LENGTH.fullmatch(text or "")
    try:
        length = float(found[1]) * _PER_UNIT[found[2] or ""] if found else 0.0
    except ValueError:  # such as 1.2.3
        return None
    return length if 0 < length < math.inf else None

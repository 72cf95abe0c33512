"""Suggest a pattern for a line that nobody has described yet, from the words and units in it."""

import json
import re
from typing import Any

_UNITS = "mm|cm|ft|m"
_DISTANCE = re.compile(rf"(?P<before>.*?)(?P<number>-?\d+(?:\.\d+)?) ?(?P<unit>{_UNITS})(?![A-Za-z])")
_NAMED = re.compile(r"(?P<before>.*?\b(?:range|distance|dist|d)\b\W{1,3})(?P<number>-?\d+(?:\.\d+)?)", re.IGNORECASE)
_ANCHOR = re.compile(
    r"(?P<word>(?:anchor|addr|address|from|to|peer|node|dst|dest|an|id|tag)[ :=_#]{0,3})(?P<name>[\w.-]*\d[\w.-]*)",
    re.IGNORECASE,
)
_DISTANCE_KEYS = re.compile(r"^(?:range|dist|distance|raz|d|r)(?:_?(?P<unit>mm|cm|m|meters?|in|ft))?$", re.IGNORECASE)
_ANCHOR_KEYS = re.compile(r"^(?:.*anchor.*|.*addr.*|dst|ouid|id|a|mac)$", re.IGNORECASE)
_WHOLE_IS_MM = 100  # a whole number beyond this is mm or cm rather than m, where the line does not say


def suggestion(line: str) -> str | None:
    """Return a pattern that may be what the author of the line means, or None where nothing looks like a range."""
    for begin in re.finditer(r"[{\[]", line):
        try:
            value = json.JSONDecoder().raw_decode(line, begin.start())[0]
        except (ValueError, RecursionError):
            continue
        if (made := _of_json(value, "")) is not None:
            return f"json: {made}"
    return _of_text(" ".join(line.split()))


def _of_text(line: str) -> str | None:
    found = _DISTANCE.search(line) or _NAMED.search(line)
    if found is None:
        return None
    before, unit = found["before"], found.groupdict().get("unit")
    text = f"{{range:{unit or _guessed(found['number'])}}}{line[found.end('number') : found.end()]}"
    anchors = list(_ANCHOR.finditer(before))
    if not anchors:
        return f"{_escaped(' '.join(before.split()[-2:]) + before[len(before.rstrip()) :])}{text}"
    anchor = anchors[-1]
    return f"{_escaped(anchor['word'])}{{anchor}}{_escaped(before[anchor.end() :])}{text}"


def _of_json(value: Any, path: str) -> str | None:
    """Return the clauses for the first object in which a key looks like a distance."""
    if isinstance(value, list):
        return _of_json(value[0], f"{path}[]") if value and "[]" not in path else None
    if not isinstance(value, dict):
        return None
    numbers = [(key, match) for key, one in value.items() if _is_number(one) and (match := _DISTANCE_KEYS.match(key))]
    if numbers:
        key, match = numbers[0]
        unit = (match["unit"] or _guessed(str(value[key]))).lower().replace("meters", "m").replace("meter", "m")
        anchor = next((name for name in value if _ANCHOR_KEYS.match(name)), None)
        named = [] if anchor is None else [f"{_joined(path, anchor)} -> anchor"]
        return ", ".join([*named, f"{_joined(path, key)} -> range:{unit}"])
    made = (_of_json(one, _joined(path, key)) for key, one in value.items())
    return next((one for one in made if one is not None), None)


def _joined(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _guessed(number: str) -> str:
    return "m" if "." in number or float(number) < _WHOLE_IS_MM else "cm"


def _is_number(value: Any) -> bool:
    if isinstance(value, str):
        return re.fullmatch(r"-?\d+(?:\.\d+)?", value) is not None
    return isinstance(value, int | float) and not isinstance(value, bool)


def _escaped(text: str) -> str:
    return text.replace("{", "{{").replace("}", "}}")

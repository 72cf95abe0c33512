"""Suggest a pattern for lines that nobody has described yet, from their words and units, and try it on all of them."""

import json
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from statistics import median
from typing import Any, NamedTuple

from dropanchor_tag_client.sources.modules.patterns.fields import PatternError
from dropanchor_tag_client.sources.modules.patterns.imu_lines import imu_patterns
from dropanchor_tag_client.sources.modules.patterns.measured import Found
from dropanchor_tag_client.sources.modules.patterns.parser import Pattern, pattern

_NUMBER = r"(?P<number>-?\d+(?:\.\d+)?)"
_RANGES = (
    re.compile(
        rf"(?P<word>\b(?:range|ranging|distance|dist|d)\b\W{{0,3}}){_NUMBER} ?(?P<unit>mm|cm|ft|m)(?![\w/]| ?=)", re.I
    ),
    re.compile(rf"(?P<word>){_NUMBER} ?(?P<unit>mm|cm|ft|m)(?![\w/]| ?=)"),
    re.compile(rf"(?P<word>\b(?:range|distance|dist|d) ?[\[(](?P<unit>mm|cm|ft|m)[\])]\W{{1,3}}){_NUMBER}", re.I),
    re.compile(rf"(?P<word>\b(?:range|distance|dist|d)(?:\b|_)[^\w.-]{{1,3}}){_NUMBER}(?![\w.])", re.I),
)
_ANCHOR = re.compile(
    r"(?P<word>\b(?:(?:mac|anchor|addr|address|peer|node|dst|dest)\b[ :=_#]{1,3}(?=[\w.:-]*\w)"
    r"|(?:anchor|addr|address|from|to|peer|node|dst|dest|mac|an|id|tag)[ :=_#]{0,3}(?=[\w.:-]*\d)))"
    r"(?P<name>(?!(?:mac|addr|address|id)\b)\w(?:[\w.:-]*\w)?)|(?P<short>\b[A-Za-z]+\d+)(?=[:=] ?$)",
    re.IGNORECASE,
)
_TOKEN_WITH_DIGIT = re.compile(r"-?(?:0x)?[A-Fa-f]*\d[\dA-Fa-f.]*(?::[\dA-Fa-f]+)*")
_TIME = re.compile(r"\{_\}(?= ?(?P<unit>ms|us|s)\b)")
_DISTANCE_KEYS = re.compile(r"^(?:range|dist|distance|raz|d|r)(?:_?(?P<unit>mm|cm|m|meters?|in|ft))?$", re.IGNORECASE)
_DISTANCES = re.compile(r"^(?:ranges?|dists?|distances?|anchors)$", re.IGNORECASE)
_ANCHOR_KEYS = re.compile(r"^(?:.*anchor.*|.*addr.*|dst|ouid|id|a|mac)$", re.IGNORECASE)
_METRES, _CENTIMETRES = 100, 3000  # numbers without a unit are hardly m beyond the one, and hardly cm beyond the other
_CLOCK_LINES = 3
_GUESS = " (the line does not say its unit: a tape measure tells)"


class Suggestion(NamedTuple):
    """pattern: fits `line` and all others like it. holds: what the pattern takes it for. warning: what is a guess."""

    pattern: str
    line: str
    holds: str
    warning: str = ""


def suggestion(lines: Sequence[str]) -> Suggestion | None:
    """Return the pattern that fits the most of the lines, and each that has the form of its own; None without one."""
    plain = [" ".join(line.split()) for line in lines]
    tried: dict[str, int] = {}
    best: tuple[int, Suggestion] | None = None
    for form in dict.fromkeys(map(_form, plain)):
        alike = [line for line in plain if _form(line) == form]
        for made in _made(alike):
            if made.pattern in tried:
                break
            tried[made.pattern] = count = _fitting(made.pattern, plain, alike)
            if count:
                best = max(best or (0, made), (count, made), key=lambda one: one[0])
                break
    return best and best[1]


def _form(line: str) -> str:
    """Return a line without what differs from measurement to measurement."""
    return _TOKEN_WITH_DIGIT.sub("0", line)


def _fitting(text: str, lines: Sequence[str], alike: Sequence[str]) -> int:
    """Return how many lines the pattern fits; 0 unless it fits all that are alike, and takes no two anchors for one."""
    try:
        made = pattern(text)
    except PatternError:
        return 0
    found = [made.found(line) or () for line in alike]
    if not all(found) or ("anchor" not in made.fields and max(map(len, found)) > 1) or not _is_clock(made, found):
        return 0
    return sum(made.found(line) is not None for line in lines)


def _is_clock(made: Pattern, found: Sequence[Sequence[Found]]) -> bool:
    """Return whether what the pattern takes for the time of the module runs forward."""
    times = [float(one[0]["t"]) for one in found] if "t" in made.fields else []
    return "t" not in made.fields or (len(times) >= _CLOCK_LINES and all(a < b for a, b in pairwise(times)))


def _made(lines: list[str]) -> Iterator[Suggestion]:
    """Yield the patterns that lines of one form may mean, the likeliest first."""
    line = lines[-1]
    for begin in re.finditer(r"[{\[]", line):
        try:
            value = json.JSONDecoder().raw_decode(line, begin.start())[0]
        except (ValueError, RecursionError):
            continue
        if (clauses := _of_json(value, "")) is not None:
            yield _with_unit(f"json: {clauses}", lines)
    for text in imu_patterns(line):
        yield Suggestion(text, line, "the axes of an IMU", " (with the units that it really has)")
    for expression in _RANGES:
        for found in expression.finditer(line):
            for text in _of_text(line, found):
                yield _with_unit(text, lines)


def _of_text(line: str, found: "re.Match[str]") -> Iterator[str]:
    """Yield the patterns for a line with this range, first with its anchor, which may stand before it or behind."""
    unit = found.groupdict().get("unit")
    head, between = line[: found.start("number")], line[found.end("number") : found.end()]
    measured = f"{{range:{unit or '?'}}}{_general(between)}"
    before, after = list(_ANCHOR.finditer(line[: found.start()])), _ANCHOR.search(line, found.end())
    if before:
        anchor = before[-1]
        yield f"{_general(anchor['word'] or '')}{{anchor}}{_general(head[anchor.end() :])}{measured}"
    words = found["word"] or " ".join(head.split()[-2:]) + head[len(head.rstrip()) :]
    if after and not before:
        yield f"{_general(words)}{measured}{_general(line[found.end() : after.start('name')])}{{anchor}}"
    bare = f"{_general(words)}{measured}"
    for time in _TIME.finditer(bare):
        yield f"{bare[: time.start()]}{{t:{time['unit']}}}{bare[time.end() :]}"
    yield bare
    yield f"{_general(found['word'])}{measured}"


def _with_unit(text: str, lines: list[str]) -> Suggestion:
    """Return the suggestion of a pattern, in which ? stands for a unit that only the values tell."""
    if "range:?" not in text:
        return Suggestion(text, lines[-1], "a range")
    values = [one for line in lines for one in _values(text, line)]
    is_whole, middle = all(value.is_integer() for value in values), median(map(abs, values)) if values else 0.0
    unit = "m" if not is_whole and middle < _METRES else "cm" if middle < _CENTIMETRES else "mm"
    return Suggestion(text.replace("range:?", f"range:{unit}"), lines[-1], "a range", _GUESS)


def _values(text: str, line: str) -> Iterator[float]:
    made: Pattern = pattern(text.replace("range:?", "range:m"))
    for found in made.found(line) or ():
        try:
            yield float(found.get("range", ""))
        except (TypeError, ValueError):
            continue


def _of_json(value: Any, path: str) -> str | None:
    """Return the clauses for the first object in which a key looks like a distance."""
    if isinstance(value, list):
        return _of_json(value[0], f"{path}[]") if value and "[]" not in path else None
    if not isinstance(value, dict):
        return None
    for key, one in value.items():
        if isinstance(one, dict) and one and _DISTANCES.match(key) and all(map(_is_number, one.values())):
            return f"{_joined(path, key)}[key] -> anchor, {_joined(path, key)}[] -> range:?"
    numbers = [(key, match) for key, one in value.items() if _is_number(one) and (match := _DISTANCE_KEYS.match(key))]
    if numbers:
        key, match = numbers[0]
        unit = (match["unit"] or "?").lower().replace("meters", "m").replace("meter", "m")
        anchor = next((name for name in value if _ANCHOR_KEYS.match(name)), None)
        named = [] if anchor is None else [f"{_joined(path, anchor)} -> anchor"]
        return ", ".join([*named, f"{_joined(path, key)} -> range:{unit}"])
    made = (_of_json(one, _joined(path, key)) for key, one in value.items())
    return next((one for one in made if one is not None), None)


def _joined(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _is_number(value: Any) -> bool:
    if isinstance(value, str):
        return re.fullmatch(r"-?\d+(?:\.\d+)?", value) is not None
    return isinstance(value, int | float) and not isinstance(value, bool)


def _general(text: str) -> str:
    """Return the text of a pattern: what has digits differs from line to line."""
    return _TOKEN_WITH_DIGIT.sub("{_}", text.replace("{", "{{").replace("}", "}}"))

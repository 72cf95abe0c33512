"""A pattern for lines of text, such as `from: {anchor} Range: {range:m} m`."""

import itertools
import re
from typing import NamedTuple

from dropanchor_tag_client.sources.modules.patterns.fields import (
    ANYTHING,
    NUMBERS,
    Field,
    PatternError,
    check_complete,
    field,
)
from dropanchor_tag_client.sources.modules.patterns.measured import Found

_NUMBER = r"(?>[-+]?(?:\d{1,20}+(?:\.\d{0,20}+)?|\.\d{1,20}+)(?:[eE][-+]?\d{1,3}+)?|-?nan|[-+]?inf|ovf)(?!\.?\d)"
_NAME_MARKS = "_.:-"  # what a name may have beside letters and digits, unless the text after it begins so
_TOKEN = re.compile(r"\{\{|\}\}|\{([^{}]*)\}|[{}]")
_EACH, _EACH_ENDS, _LINE_BEGINS, _LINE_ENDS = "each", "/each", "start", "end"


class _Part(NamedTuple):
    """A part of a pattern: text, a field, or one of the words start, each, /each and end. at: its place."""

    at: int
    text: str = ""
    field: Field | None = None
    word: str = ""


class TextPattern:
    """Finds its fields in a line: as often as the pattern occurs, or as often as its part between each and /each."""

    def __init__(self, pattern: str) -> None:
        """Raises PatternError."""
        parts = _parts(pattern)
        self.fields = {part.field.name: part.field for part in parts if part.field is not None}
        check_complete([part.field.name for part in parts if part.field is not None], pattern)
        before, each, after = _divided(parts, pattern)
        for group in (before, [*each, *each], after):
            _check_separated(group, pattern)
        self._before, self._repeated, self._after = _names(before), _names(each), _names(after)
        repeats = f"((?>(?:{_expression(each, capture=False)})+))" if each else ""
        whole = _expression(before, capture=True) + repeats + _expression(after, capture=True)
        self._line = re.compile(_bounded(parts, whole), re.IGNORECASE)
        self._each = re.compile(_expression(each, capture=True), re.IGNORECASE)

    def found(self, line: str) -> list[Found] | None:
        """Return what stands in the fields, for each measurement of the line; None if it is another line."""
        matches = list(self._line.finditer(" ".join(line.split())))
        return [one for match in matches for one in self._measurements(match)] if matches else None

    def _measurements(self, match: re.Match[str]) -> list[Found]:
        values, count = match.groups(), len(self._before)
        once = dict(zip(self._before, values[:count], strict=True))
        if not self._repeated:
            return [once]
        once |= dict(zip(self._after, values[count + 1 :], strict=True))
        repeats = self._each.finditer(values[count])
        return [once | dict(zip(self._repeated, one.groups(), strict=True)) for one in repeats]


def _parts(pattern: str) -> list[_Part]:
    """Return the parts of a pattern. Spaces and tabs, also those written as \\t, are one space. Raises PatternError."""
    parts, text, at = list[_Part](), "", 0
    for token in _TOKEN.finditer(pattern):
        text += pattern[at : token.start()]
        at = token.end()
        if token[0] in ("{{", "}}"):
            text += token[0][0]
            continue
        if token[1] is None:
            raise PatternError(
                f'a single "{token[0]}": a brace of the line itself is written twice', pattern, token.start()
            )
        parts += [*_literal(text, token.start()), _braced(token[1], pattern, token.start())]
        text = ""
    parts += _literal(text + pattern[at:], len(pattern))
    return _stripped(parts)


def _braced(text: str, pattern: str, at: int) -> _Part:
    if text.strip() in (_EACH, _EACH_ENDS, _LINE_BEGINS, _LINE_ENDS):
        return _Part(at, word=text.strip())
    return _Part(at, field=field(text, pattern, at))


def _literal(text: str, end: int) -> list[_Part]:
    collapsed = re.sub(r"(?:\s|\\t)+", " ", text)
    return [_Part(end - len(text), text=collapsed)] if collapsed else []


def _stripped(parts: list[_Part]) -> list[_Part]:
    """Leave out spaces where the line begins and ends: those of the line are left out, too."""
    if parts and parts[0].text:
        parts[0] = parts[0]._replace(text=parts[0].text.lstrip())
    if parts and parts[-1].text:
        parts[-1] = parts[-1]._replace(text=parts[-1].text.rstrip())
    return [part for part in parts if part.text or part.field or part.word]


def _divided(parts: list[_Part], pattern: str) -> tuple[list[_Part], list[_Part], list[_Part]]:
    """Return the parts before, inside and after each … /each. Raises PatternError."""
    words = {part.word: index for index, part in enumerate(parts) if part.word}
    for part in parts:
        if part.word and parts[words[part.word]] is not part:
            raise PatternError(f'"{part.word}" may be there once', pattern, part.at)
    if (_EACH in words) != (_EACH_ENDS in words) or words.get(_EACH, 0) > words.get(_EACH_ENDS, 0):
        begun = _EACH if _EACH in words else _EACH_ENDS
        raise PatternError("{each} and {/each} belong together, in this order", pattern, parts[words[begun]].at)
    if _LINE_ENDS in words and words[_LINE_ENDS] != len(parts) - 1:
        raise PatternError("nothing can follow {end}, the end of the line", pattern, parts[words[_LINE_ENDS]].at)
    if words.get(_LINE_BEGINS):
        raise PatternError("nothing can stand before {start}, the start of the line", pattern, 0)
    if _EACH not in words:
        return parts, [], []
    begin, end = words[_EACH], words[_EACH_ENDS]
    return parts[:begin], parts[begin + 1 : end], parts[end + 1 :]


def _check_separated(parts: list[_Part], pattern: str) -> None:
    for part, after in itertools.pairwise(parts):
        if part.field is not None and after.field is not None:
            raise PatternError("two fields need something between them", pattern, after.at)


def _names(parts: list[_Part]) -> list[str]:
    return [part.field.name for part in parts if part.field is not None and part.field.name != ANYTHING]


def _expression(parts: list[_Part], *, capture: bool) -> str:
    """Return the regular expression of some parts, with or without groups for the fields."""
    pieces, index = list[str](), 0
    while index < len(parts):
        before, part, after = parts[index - 1] if index else None, parts[index], next(iter(parts[index + 1 :]), None)
        if _is_anything(part):  # up to the first place where the text after it stands, and never further
            pieces.append(f"(?>.*?{_text(after, part, None)})" if after is not None and after.text else "(?>.*)")
            index += 1 + (after is not None and bool(after.text))
            continue
        pieces.append(_text(part, before, after) if part.text else _piece(part, after, capture=capture))
        index += 1
    return "".join(pieces)


def _piece(part: _Part, after: _Part | None, *, capture: bool) -> str:
    if part.word:
        return "^" if part.word == _LINE_BEGINS else "$"
    is_number = _is_number(part)
    group = _NUMBER if is_number else _name_expression(after)
    unit = "" if after is not None and after.text else _no_other_unit(part)
    return f"{' ?' if is_number else ''}({'' if capture else '?:'}{group}){unit}"


def _no_other_unit(part: _Part) -> str:
    """Return the expression that no length of another unit stands here: a pattern in m is not for `12 cm`."""
    units = NUMBERS.get(part.field.name, {}) if part.field is not None else {}
    others = [
        unit for unit, scale in units.items() if part.field is not None and scale != part.field.scale and unit != "in"
    ]
    return rf"(?! ?(?:{'|'.join(others)})(?![A-Za-z]))" if part.field and part.field.name in ("range", "std") else ""


def _name_expression(after: _Part | None) -> str:
    marks = "".join(mark for mark in _NAME_MARKS if after is None or not after.text.startswith(mark))
    return f"[A-Za-z0-9{re.escape(marks)}]{{1,64}}"


def _text(part: _Part, before: _Part | None, after: _Part | None) -> str:
    """Return the expression of a text. A space between a number and other text may be missing, as in 3.21 m."""
    text = part.text
    begins = " ?" if before is not None and _is_number(before) and text.startswith(" ") and text.strip() else ""
    text = text.lstrip() if begins else text
    text = text.rstrip() if after is not None and _is_number(after) and text.strip() else text
    return begins + re.escape(text)


def _is_number(part: _Part) -> bool:
    return part.field is not None and part.field.name in NUMBERS


def _is_anything(part: _Part) -> bool:
    return part.field is not None and part.field.name == ANYTHING


def _bounded(parts: list[_Part], expression: str) -> str:
    """Return the expression for whole words: `an0:0.55m` stands neither in `plan0:0.55m` nor in `an0:0.55mm`."""
    first, last = parts[0], parts[-1]
    begins = r"(?<![\w.:+-])" if first.field else r"(?<![A-Za-z])" if first.text[:1].isalpha() else ""
    is_name = last.field is not None and not _is_number(last) and not _is_anything(last)
    ends = r"(?![\w.:-])" if is_name else r"(?![A-Za-z])" if last.text[-1:].isalpha() else ""
    return begins + expression + ends

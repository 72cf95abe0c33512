"""A pattern for lines that hold JSON, such as `json: links[].A -> anchor, links[].R -> range:m`."""

import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from dropanchor_tag_client.sources.modules.patterns.fields import Field, PatternError, check_complete, field
from dropanchor_tag_client.sources.modules.patterns.measured import Found

PREFIX = "json:"
_ARROW, _EQUALS, _EACH, _KEY = "->", "=", "[]", "[key]"
_STEP = re.compile(r"\.?([^.\[\]\s]+)|\[(\d+|key)?\]")
_VALUE_BEGINS = re.compile(r"[{\[]")
_MAX_ATTEMPTS = 8  # a line may have a prompt, a time and the like before its JSON
_MISSING = object()

_Path = tuple[str | int, ...]


class _Clause(NamedTuple):
    """Where a value stands, and what it is: a field, or a text that it has to be. each: the list to go through."""

    each: _Path | None
    path: _Path
    field: Field | None
    text: str = ""


class JsonPattern:
    """Finds its fields in the JSON of a line, once for each element of a list, or once."""

    def __init__(self, pattern: str) -> None:
        """Raises PatternError."""
        clauses = list(_clauses(pattern))
        self._where = [clause for clause in clauses if clause.field is None]
        self._wanted = [clause for clause in clauses if clause.field is not None]
        self.fields = {one.field.name: one.field for one in self._wanted if one.field is not None}
        check_complete([one.field.name for one in self._wanted if one.field is not None], pattern)
        lists = {clause.each for clause in clauses if clause.each is not None}
        if len(lists) > 1:
            raise PatternError("a pattern can go through one list only", pattern, pattern.rindex(_EACH))
        self._list = next(iter(lists), None)

    def found(self, line: str) -> list[Found] | None:
        """Return what stands in the fields, for each measurement of the line; None if it is another line."""
        for value in _values(line):
            if (measured := self._measurements(value)) is not None:
                return measured
        return None

    def _measurements(self, value: Any) -> list[Found] | None:
        if self._list is None:
            found = self._fields(value, _MISSING, None)
            return None if found is None or not self._is_useful(found) else [found]
        elements = _elements(_at(value, self._list))
        if elements is None:
            return None
        measured = [one for key, element in elements if (one := self._fields(value, element, key)) is not None]
        return measured if not elements or any(self._is_useful(one) for one in measured) else None

    def _is_useful(self, found: Found) -> bool:
        """Return whether the line is one that the pattern describes: a range may be missing, or an anchor, not both."""
        return any(name in found for name in ("range", "anchor", "ax"))

    def _fields(self, value: Any, element: Any, key: str | int | None) -> Found | None:
        """Return the fields of an element. Where a condition is not met, the range is missing."""

        def there(clause: _Clause) -> Any:
            if clause.path == (_KEY,):
                return key
            return _at(value if clause.each is None else element, clause.path)

        values = {one.field.name: there(one) for one in self._wanted if one.field is not None}
        is_met = [str(there(one)) == one.text for one in self._where]
        if not all(met for met, one in zip(is_met, self._where, strict=True) if one.each is None):
            return None
        return {name: one for name, one in values.items() if one is not _MISSING and (all(is_met) or name != "range")}


def _clauses(pattern: str) -> Iterator[_Clause]:
    """Return the clauses `PATH -> FIELD` and `PATH = TEXT` of a pattern, which commas separate. Raises PatternError."""
    at = pattern.index(PREFIX) + len(PREFIX)
    for text in pattern[at:].split(","):
        path, sign, target = text.partition(_ARROW if _ARROW in text else _EQUALS)
        if not sign or not path.strip() or not target.strip():
            raise PatternError("PATH -> FIELD was expected, such as d -> range:m", pattern, at)
        each, steps = _path(path.strip(), pattern, at + len(path) - len(path.lstrip()))
        begin = at + len(path) + len(sign) + len(target) - len(target.lstrip())
        is_field = sign == _ARROW
        yield _Clause(each, steps, field(target, pattern, begin) if is_field else None, target.strip().strip('"'))
        at += len(text) + 1


def _path(text: str, pattern: str, begin: int) -> tuple[_Path | None, _Path]:
    """Return the path of the list to go through, if there is one, and the path from there. Raises PatternError."""
    each, steps, at = None, list[str | int](), 0
    while at < len(text):
        step = _STEP.match(text, at)
        if step is None or _KEY in steps or (each is not None and step[0] in (_EACH, _KEY)):
            problem = "a path is a chain of names and [0], [] or [key], such as results[].Addr"
            raise PatternError(problem, pattern, begin + at)
        if step[0] in (_EACH, _KEY):
            each, steps = tuple(steps), [_KEY] if step[0] == _KEY else []
        else:
            steps.append(step[1] if step[1] is not None else int(step[2]))
        at = step.end()
    return each, tuple(steps)


def _values(line: str) -> Iterator[Any]:
    """Return the objects and lists of a line, from each place where one can begin."""
    decoder = json.JSONDecoder()
    for _, begin in zip(range(_MAX_ATTEMPTS), _VALUE_BEGINS.finditer(line), strict=False):
        try:
            yield decoder.raw_decode(line, begin.start())[0]
        except (ValueError, RecursionError):
            continue


def _at(value: Any, path: _Path) -> Any:
    """Return what stands at a path, or _MISSING."""
    for step in path:
        in_object = isinstance(value, dict) and step in value
        in_list = isinstance(value, list) and isinstance(step, int) and step < len(value)
        if not in_object and not in_list:
            return _MISSING
        value = value[step]
    return value


def _elements(value: Any) -> list[tuple[str | int, Any]] | None:
    if isinstance(value, dict):
        return list(value.items())
    return list(enumerate(value)) if isinstance(value, list) else None

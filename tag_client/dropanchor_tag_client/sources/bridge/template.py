"""Messages of any other form, by rules from a TOML file: from topic to tag, from JSON path to field.

[[rule]]
topic = "plant/+/uwb"            # a filter; {1} below is what the first + stands for
tag = "cart-{1}"                 # or "{device.id}": from the payload
kind = "range"                   # range, imu, heading or bearing
each = "anchors"                 # optional: a list in the payload; paths begin at each of its elements. The time
                                 # and the tag may stand beside the list
time_unit = "ms"                 # of t_ns: ns, us, ms or s; without t_ns the time of arrival is used
[rule.fields]
anchor = "id"                    # a path: names and list indices with dots; "=yard" is the text yard itself
range_m = "distance_cm"
t_ns = "time"
[rule.scale]
range_m = 0.01
"""

import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from dropanchor_schemas.kinds import KINDS
from dropanchor_tag_client.sources.bridge.measurement import Drop, Dropped, Measurement, json_of
from dropanchor_tag_client.sources.publish import fields_of

_NS_PER = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}
_KNOWN = {"topic", "tag", "kind", "each", "time_unit", "fields", "scale"}
_PLACE = re.compile(r"\{([^{}]+)\}")

_Path = str | list[str]


class TemplateError(ValueError):
    """The file of rules is wrong. The message says where and what."""


class _MissingError(Exception):
    """The payload has nothing at a path."""


class Rule(NamedTuple):
    """One table `[[rule]]`."""

    topic: str
    tag: str
    kind: str
    fields: dict[str, _Path]
    each: str | None = None
    time_unit: str = "ns"
    scale: Mapping[str, float] = MappingProxyType({})

    def parse(self, topic: str, value: Any, t_ns: int) -> Iterator[Measurement | Dropped]:
        wildcards = _wildcards(self.topic, topic)
        try:
            parts = [value] if self.each is None else _at(value, self.each)
            if not isinstance(parts, list):
                raise _MissingError(self.each)
        except _MissingError as missing:
            yield Dropped(Drop.NOT_UNDERSTOOD, f"{topic}: the payload has no list {missing}")
            return
        for part in parts:
            try:
                yield Measurement(self._tag(wildcards, value, part), self.kind, self._values(part, value, t_ns))
            except _MissingError as missing:
                yield Dropped(Drop.NOT_UNDERSTOOD, f"{topic}: the payload has no usable {missing}")

    def _tag(self, wildcards: list[str], value: Any, part: Any) -> str:
        def replaced(place: re.Match[str]) -> str:
            name = place[1]
            if name.isdecimal():
                return wildcards[int(name) - 1]
            return str(_of_part_or_payload(part, value, name))

        return _PLACE.sub(replaced, self.tag)

    def _values(self, part: Any, value: Any, t_ns: int) -> dict[str, Any]:
        found = {name: self._field(part, value, name, path) for name, path in self.fields.items()}
        return {"t_ns": t_ns} | found

    def _field(self, part: Any, payload: Any, name: str, path: _Path) -> Any:
        if isinstance(path, list):
            return [self._scaled(_at(part, one), name, one) for one in path]
        if path.startswith("="):
            return path[1:]
        if name == "t_ns":
            return self._time(_of_part_or_payload(part, payload, path), path)
        value = _at(part, path)
        if isinstance(value, list):
            return [self._scaled(one, name, path) for one in value]
        return self._scaled(value, name, path)

    def _scaled(self, value: Any, name: str, path: str) -> Any:
        if name not in self.scale:
            return value
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _MissingError(path)
        return value * self.scale[name]

    def _time(self, value: Any, path: str) -> int:
        try:
            return (
                int(value) * _NS_PER[self.time_unit]
                if isinstance(value, int | str)
                else round(value * _NS_PER[self.time_unit])
            )
        except (TypeError, ValueError, OverflowError):
            raise _MissingError(path) from None


class Template:
    """The rules of one file."""

    def __init__(self, path: Path) -> None:
        self._rules = _rules(path)
        self.topics = tuple(dict.fromkeys(rule.topic for rule in self._rules))

    def parse(self, topic: str, payload: bytes, t_ns: int) -> Iterator[Measurement | Dropped]:
        value = json_of(payload)
        if isinstance(value, Dropped):
            yield value
            return
        for rule in self._rules:
            if matches(rule.topic, topic):
                yield from rule.parse(topic, value, t_ns)


def matches(pattern: str, topic: str) -> bool:
    """Return whether an MQTT topic matches a filter."""
    wanted, levels = pattern.split("/"), topic.split("/")
    if wanted[-1] == "#":
        wanted.pop()
        levels = levels[: len(wanted)]
    return len(wanted) == len(levels) and all(a in ("+", b) for a, b in zip(wanted, levels, strict=True))


def _wildcards(pattern: str, topic: str) -> list[str]:
    return [level for wanted, level in zip(pattern.split("/"), topic.split("/"), strict=False) if wanted == "+"]


def _at(value: Any, path: str) -> Any:
    """Return what a payload has at a path. Raises _MissingError."""
    for name in path.split("."):
        try:
            value = value[int(name)] if isinstance(value, list) else value[name]
        except (KeyError, IndexError, TypeError, ValueError):
            raise _MissingError(path) from None
    return value


def _of_part_or_payload(part: Any, payload: Any, path: str) -> Any:
    """Return what an element of a list has at a path, or the payload around it. Raises _MissingError."""
    try:
        return _at(part, path)
    except _MissingError:
        return _at(payload, path)


def _rules(path: Path) -> list[Rule]:
    try:
        tables = tomllib.loads(path.read_text("utf-8")).get("rule")
    except (OSError, ValueError) as error:
        raise TemplateError(f"{path}: {error}") from error
    if not isinstance(tables, list) or not tables:
        raise TemplateError(f"{path} has no table [[rule]]")
    return [_rule(table, f"{path}: rule {number}") for number, table in enumerate(tables, start=1)]


def _rule(table: Any, where: str) -> Rule:
    if not isinstance(table, dict) or (unknown := table.keys() - _KNOWN):
        raise TemplateError(f"{where}: there is no key {min(unknown)!r}; known are {', '.join(sorted(_KNOWN))}")
    for name in ("topic", "tag", "kind", "fields"):
        if name not in table:
            raise TemplateError(f"{where}: {name} is missing")
    kind, fields = table["kind"], table["fields"]
    kinds = [one.name for one in KINDS]
    if kind not in kinds:
        raise TemplateError(f"{where}: kind is {kind!r}; one of {', '.join(kinds)} was expected")
    needed, optional = fields_of(kind)
    if not isinstance(fields, dict) or not {*needed} <= fields.keys() <= {*needed, *optional}:
        raise TemplateError(f"{where}: fields are {', '.join(needed)}, and optionally {', '.join(optional)}")
    if table.get("time_unit", "ns") not in _NS_PER:
        raise TemplateError(f"{where}: time_unit is one of {', '.join(_NS_PER)}")
    _check_texts(table, where)
    return Rule(**table)


def _check_texts(table: dict[str, Any], where: str) -> None:
    texts = [table["topic"], table["tag"], table.get("each", "-")]
    for path in table["fields"].values():
        texts += path if isinstance(path, list) else [path]
    if not all(isinstance(text, str) and text for text in texts):
        raise TemplateError(f"{where}: topic, tag, each and the paths of fields are texts")
    scale = table.get("scale", {})
    if not isinstance(scale, dict) or not all(
        isinstance(factor, int | float) and math.isfinite(factor) for factor in scale.values()
    ):
        raise TemplateError(f"{where}: scale holds numbers")
    places = [int(place) for place in _PLACE.findall(table["tag"]) if place.isdecimal()]
    if any(not 1 <= place <= table["topic"].split("/").count("+") for place in places):
        raise TemplateError(f"{where}: tag names a + that the topic does not have")

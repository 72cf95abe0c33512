"""The TOML file of rules, and what can be wrong with it."""

import math
import tomllib
from collections.abc import Iterator
from datetime import UTC, tzinfo
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

from dropanchor_schemas.kinds import KINDS
from dropanchor_tag_client.sources.bridge.places import shown, unknown_place
from dropanchor_tag_client.sources.bridge.rule import Rule
from dropanchor_tag_client.sources.bridge.topics import is_filter
from dropanchor_tag_client.sources.bridge.values import NS_PER, UNITS, Reader
from dropanchor_tag_client.sources.modules.device_clock import DeviceClock
from dropanchor_tag_client.sources.publish import fields_of

_NEEDED = ("topic", "tag", "kind", "fields")
_OPTIONAL = ("each", "time_unit", "time_zone", "decimal_comma", "unit", "scale", "retained", "clock")


class TemplateError(ValueError):
    """The file of rules is wrong. The message says where and what."""


def rules_of(path: Path) -> list[Rule]:
    """Return the rules of a file. Raises TemplateError."""
    try:
        tables = tomllib.loads(path.read_text("utf-8")).get("rule")
    except (OSError, ValueError) as error:
        raise TemplateError(f"{path}: {error}") from error
    if not isinstance(tables, list) or not tables:
        raise TemplateError(f"{path} has no table [[rule]]")
    clocks: dict[str, DeviceClock] = {}
    return [_rule(table, f"{path}: rule {number}", clocks) for number, table in enumerate(tables, start=1)]


def _rule(table: Any, where: str, clocks: dict[str, DeviceClock]) -> Rule:
    try:
        _check_keys(table)
        _check_texts(table)
        return Rule(
            table["topic"],
            table["tag"],
            table["kind"],
            table["fields"],
            _each(table),
            _factors(table),
            _reader(table),
            _flag(table, "retained"),
            clocks if _counts_from_boot(table) else None,
        )
    except ValueError as error:
        raise TemplateError(f"{where}: {error}") from None


def _check_keys(table: Any) -> None:
    if not isinstance(table, dict):
        raise ValueError(f"it is {shown(table)}, a table was expected")
    known = (*_NEEDED, *_OPTIONAL)
    if unknown := table.keys() - {*known}:
        raise ValueError(f"there is no key {min(unknown)!r}; known are {', '.join(sorted(known))}")
    for name in _NEEDED:
        if name not in table:
            raise ValueError(f"{name} is missing")
    kind, fields = table["kind"], table["fields"]
    kinds = [one.name for one in KINDS]
    if kind not in kinds:
        raise ValueError(f"kind is {kind!r}; one of {', '.join(kinds)} was expected")
    needed, optional = fields_of(kind)
    if not isinstance(fields, dict) or not {*needed} <= fields.keys() <= {*needed, *optional}:
        raise ValueError(f"fields are {', '.join(needed)}, and optionally {', '.join(optional)}")


def _check_texts(table: dict[str, Any]) -> None:
    """Check the filter, and that all sources are texts whose places are known."""
    topic, has_each = table["topic"], "each" in table
    if not isinstance(topic, str) or not is_filter(topic):
        raise ValueError(f"topic is {shown(topic)}; a filter such as uwb/+ or uwb/# was expected")
    for name, source in _sources(table):
        if not isinstance(source, str) or not source:
            raise ValueError(f"{name} is {shown(source)}, a text was expected")
        problem = unknown_place(source, topic, has_each)
        if problem is not None:
            raise ValueError(f"{name}: {problem}")


def _sources(table: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    yield "tag", table["tag"]
    for name, source in table["fields"].items():
        for one in source if isinstance(source, list) and source else [source]:
            yield f"fields.{name}", one


def _each(table: dict[str, Any]) -> tuple[str, ...]:
    each = table.get("each", [])
    paths = [each] if isinstance(each, str) else each
    if not isinstance(paths, list) or not all(isinstance(path, str) and path for path in paths):
        raise ValueError(f"each is {shown(each)}; the path of a list or an object, or paths of lists, was expected")
    return tuple(paths)


def _factors(table: dict[str, Any]) -> dict[str, float]:
    """Return what the values of each field are multiplied with, for its unit or by its scale."""
    units, scales = _of_fields(table, "unit"), _of_fields(table, "scale")
    for name, unit in units.items():
        if not isinstance(unit, str) or unit not in UNITS[name]:
            raise ValueError(f"unit.{name} is {shown(unit)}; one of {', '.join(UNITS[name])} was expected")
    for name, factor in scales.items():
        if isinstance(factor, bool) or not isinstance(factor, int | float) or not math.isfinite(factor):
            raise ValueError(f"scale.{name} is {shown(factor)}; scale holds numbers")
    if both := units.keys() & scales.keys():
        raise ValueError(f"{min(both)} has both a unit and a scale")
    return {name: UNITS[name][unit] for name, unit in units.items()} | scales


def _of_fields(table: dict[str, Any], key: str) -> dict[str, Any]:
    """Return the table of a key by the names of fields."""
    found = table.get(key, {})
    if not isinstance(found, dict):
        raise ValueError(f"{key} is {shown(found)}; a table of fields was expected")
    if unknown := found.keys() - table["fields"].keys():
        raise ValueError(f"{key} names {min(unknown)!r}, which is not in fields")
    if wrong := {"anchor", "t_ns"} & found.keys():
        raise ValueError(f"{key} names {min(wrong)!r}, which has none; the times have time_unit")
    return found


def _reader(table: dict[str, Any]) -> Reader:
    unit, zone = table.get("time_unit", "ns"), table.get("time_zone")
    if not isinstance(unit, str) or unit not in NS_PER:
        raise ValueError(f"time_unit is one of {', '.join(NS_PER)}")
    return Reader(unit, None if zone is None else _zone(zone), _flag(table, "decimal_comma"))


def _zone(name: Any) -> tzinfo:
    try:
        return UTC if name == "UTC" else ZoneInfo(name)
    except (KeyError, ValueError, TypeError, AttributeError, OSError):
        raise ValueError(f"time_zone is {shown(name)}; a name such as UTC or Europe/Berlin was expected") from None


def _counts_from_boot(table: dict[str, Any]) -> bool:
    clock = table.get("clock", "utc")
    if clock not in ("utc", "boot"):
        raise ValueError(f"clock is {shown(clock)}; utc or boot was expected")
    if clock == "boot" and ("t_ns" not in table["fields"] or "time_zone" in table):
        raise ValueError('clock = "boot" needs t_ns in fields, a number, and no time_zone')
    return bool(clock == "boot")


def _flag(table: dict[str, Any], name: str) -> bool:
    found = table.get(name, False)
    if not isinstance(found, bool):
        raise ValueError(f"{name} is {shown(found)}; true or false was expected")
    return found

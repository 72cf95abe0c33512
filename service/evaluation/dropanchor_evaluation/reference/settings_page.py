"""The page of all settings: key, type, unit, default and meaning, from the models."""

import re
from collections.abc import Iterator
from pathlib import PurePath
from typing import Any, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from dropanchor_evaluation.reference.markdown import table
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import model_in

HEADER = ("key", "type", "unit", "default", "meaning")
_INTRODUCTION = """\
# Settings

`dropanchor serve --config site.toml` reads a TOML file. The environment variable of `port` in `[http]` is
`DROPANCHOR_HTTP__PORT`. A key that does not exist is an error that names the file, the key and the nearest one that
does exist.

## Which value holds

For each value, the first of these that has it:

1. what was set over REST or on the page: of the site (but not its `id`), of anchors, of tags
2. the option of the command
3. the environment variable
4. the settings file: of a tag, `[tags.<id>]` before `[tag_defaults]`
5. the default; for a site without anchors, the anchor of the first range

This holds for each key of the site and of a tag, and for each anchor as a whole, so what nobody has set over REST
follows the settings file at each start. `georeference` and `start` are one value each. An anchor or a tag that was
deleted over REST stays deleted, also when the file has it. A value that is put over REST as it is configured is not
kept as set: that gives it back. `site.json` in `data_dir` holds what was set, and nothing else.

`dropanchor settings --show` prints every value in force, where it comes from, and what it hides; `--json` writes JSON.
`GET /api/v1/settings` and the page show the same of a site, and the page gives values back.

## Tags

`[tags.<id>]` holds the settings of one tag, and `[tag_defaults]` those of all tags that do not say otherwise. Quote
an id in TOML where it holds more than letters, digits, `_` and `-`.
"""
_UNITS = {
    "ms": "ms",
    "s": "s",
    "m": "m",
    "rad": "rad",
    "mps": "m/s",
    "mib": "MiB",
    "days": "d",
    "hours": "h",
    "minutes": "min",
    "per_s": "1/s",
}


def page() -> str:
    """Return the page as Markdown."""
    sections = [
        f"## {title}\n\n{text}\n" + (f"\n{table(HEADER, rows)}" if rows else "")
        for title, text, rows in _sections(Settings, "", "", {})
    ]
    return "\n".join([_INTRODUCTION, *sections])


def _sections(
    model: type[BaseModel], path: str, text: str, shown: dict[type[BaseModel], str]
) -> Iterator[tuple[str, str, list[tuple[str, ...]]]]:
    """Yield title, introduction and rows of this model's own keys, then of each section below it.

    shown: titles of the models that have a section already, whose keys are not repeated.
    """
    title = f"`[{path}]`" if path else "Top level"
    if model in shown:
        yield title, f"{text} The keys are those of {shown[model]}.", []
        return
    shown[model] = title
    rows: list[tuple[str, ...]] = []
    below: list[tuple[type[BaseModel], str, str]] = []
    for name, field in model.model_fields.items():
        section = model_in(field.annotation)
        if section is None:
            rows.append(_row(name, field))
        else:
            below.append((section, _path_of(path, name, field), field.description or ""))
    if rows:
        yield title, _first_paragraph(model), rows
    for section, inner, description in below:
        yield from _sections(section, inner, description, shown)


def _path_of(path: str, name: str, field: FieldInfo) -> str:
    inner = f"{path}.{name}" if path else name
    origin = str(field.annotation)
    if origin.startswith("dict"):
        return f"{inner}.<id>"
    return f"[{inner}]" if origin.startswith("list") else inner


def _first_paragraph(model: type[BaseModel]) -> str:
    return " ".join((model.__doc__ or "").split("\n\n")[0].split())


def _row(name: str, field: FieldInfo) -> tuple[str, ...]:
    return (f"`{name}`", _type_of(field), _unit_of(name), _default_of(field), field.description or "")


def _unit_of(name: str) -> str:
    endings = (ending for ending in sorted(_UNITS, key=len, reverse=True) if name.endswith(f"_{ending}"))
    return next((_UNITS[ending] for ending in endings), "m" if name in ("x", "y", "z") else "")


def _default_of(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    default = field.default
    match default:
        case None:
            return "not set"
        case bool():
            return f"`{str(default).lower()}`"
        case tuple() | list():
            return f"`{list(map(str, default))}`".replace("'", '"')
        case str() | PurePath():
            return f'`"{default}"`'
        case _:
            return f"`{default}`"


def _type_of(field: FieldInfo) -> str:
    limits = [_limit(item) for item in _metadata(field.annotation, field.metadata)]
    return ", ".join([_type_name(field.annotation), *filter(None, limits)])


def _metadata(annotation: Any, own: list[Any]) -> list[Any]:
    """Return the constraints of a field, also those inside an optional."""
    inner = [item for argument in get_args(annotation) for item in getattr(argument, "__metadata__", ())]
    flat: list[Any] = []
    for item in [*own, *inner]:
        flat += item.metadata if isinstance(item, FieldInfo) else [item]
    return flat


def _limit(item: Any) -> str:
    match item:
        case Ge(ge=value):
            return f"≥ {value}"
        case Gt(gt=value):
            return f"> {value}"
        case Le(le=value):
            return f"≤ {value}"
        case Lt(lt=value):
            return f"< {value}"
        case _:
            return ""


def _type_name(annotation: Any) -> str:
    literals = re.findall(r"'([^']+)'", str(annotation)) if "Literal" in str(annotation) else []
    if literals:
        keys = "table with the keys " if str(annotation).startswith("dict") else ""
        return keys + " or ".join(f'`"{literal}"`' for literal in literals)
    text = str(annotation)
    known = (
        ("dict", "table of numbers"),
        ("tuple", "list of texts"),
        ("Path", "path"),
        ("float", "number"),
        ("bool", "true or false"),
        ("int", "integer"),
        ("str", "text"),
    )
    return next((word for part, word in known if part in text), text)

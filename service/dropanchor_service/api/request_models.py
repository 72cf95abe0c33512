"""Models of requests beside those of answers: a client may leave out what has a default, the service never does.

Many generators make of a member with a `default` one that is always there. That is true of answers only.
"""

from collections.abc import Iterable, Mapping
from copy import deepcopy
from typing import Any

Json = Any
Schemas = dict[str, dict[str, Json]]

_PREFIX = "#/components/schemas/"


def separate_requests(document: dict[str, Any]) -> None:
    """Give the models of requests no defaults, under names of their own where answers have the same model."""
    schemas: Schemas = document["components"]["schemas"]
    operations = [operation for item in document["paths"].values() for operation in item.values()]
    asked = _reached([operation.get("requestBody") for operation in operations], schemas)
    answered = (set(schemas) - asked) | _reached([operation["responses"] for operation in operations], schemas)
    differing = {name for name in asked if any(map(_has_defaults, _with_parts(name, schemas)))}
    names = {name: f"{name}Request" for name in differing & answered}
    requests = {
        names.get(name, name): _renamed(_optional(schemas[name]), names) | {"title": names.get(name, name)}
        for name in differing
    }
    for name in answered:
        _always_there(schemas[name])
    document["components"]["schemas"] = dict(sorted((schemas | requests).items()))
    for operation in operations:
        if "requestBody" in operation:
            operation["requestBody"] = _renamed(operation["requestBody"], names)


def _reached(parts: Iterable[Json], schemas: Schemas) -> set[str]:
    """Return the names of all schemas to which these parts lead."""
    found: set[str] = set()
    waiting = list(parts)
    while waiting:
        match waiting.pop():
            case dict() as members:
                waiting.extend(members.values())
            case list() as items:
                waiting.extend(items)
            case str() as text if text.startswith(_PREFIX) and text.removeprefix(_PREFIX) not in found:
                found.add(text.removeprefix(_PREFIX))
                waiting.append(schemas[text.removeprefix(_PREFIX)])
    return found


def _with_parts(name: str, schemas: Schemas) -> list[dict[str, Json]]:
    """Return a schema and all those to which it leads."""
    return [schemas[part] for part in _reached([_PREFIX + name], schemas)]


def _members(schema: Mapping[str, Json]) -> dict[str, dict[str, Json]]:
    members: dict[str, dict[str, Json]] = schema.get("properties", {})
    return members


def _has_defaults(schema: Mapping[str, Json]) -> bool:
    return any("default" in member for member in _members(schema).values())


def _optional(schema: dict[str, Json]) -> dict[str, Json]:
    """Return the schema with its defaults told in words alone."""
    schema = deepcopy(schema)
    for member in _members(schema).values():
        default = member.pop("default", None)
        if default is not None:
            said = f"The default is `{_text(default)}`."
            member["description"] = f"{member['description']} {said}" if "description" in member else said
    return schema


def _text(value: Json) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return f'"{value}"'
    return str(value)


def _always_there(schema: dict[str, Json]) -> None:
    """Make the members with a default required. One that is null, or made by a `default_factory`, may be missing."""
    members = _members(schema)
    defaults = {name: member.pop("default") for name, member in members.items() if "default" in member}
    required = {*schema.get("required", []), *(name for name, value in defaults.items() if value is not None)}
    if required:
        schema["required"] = [name for name in members if name in required]


def _renamed(part: Json, names: Mapping[str, str]) -> Json:
    """Return a part of the document that leads to the renamed schemas."""
    match part:
        case dict():
            return {key: _renamed(value, names) for key, value in part.items()}
        case list():
            return [_renamed(item, names) for item in part]
        case str() if part.removeprefix(_PREFIX) in names and part.startswith(_PREFIX):
            return _PREFIX + names[part.removeprefix(_PREFIX)]
    return part

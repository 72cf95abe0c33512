"""What a client of the interface can see of an OpenAPI document: one entry for each operation, parameter and field.

An entry's name says where it is, such as `GET /api/v1/poses > 200 application/json .poses[].tag`: `?` is a parameter,
`<` a request, `>` an answer. Its value has the types that it may have; `optional` is among them if it may be missing.
"""

from collections.abc import Iterator, Mapping
from typing import Any

Surface = dict[str, list[str]]
Entry = tuple[str, list[str]]
Json = Any
Schemas = Mapping[str, Json]

OPTIONAL = "optional"
_PREFIX = "#/components/schemas/"
_OF_SITE = "/api/v1/sites/{site}/"
_METHODS = ("get", "put", "post", "patch", "delete")


def surface_of(document: Mapping[str, Json]) -> Surface:
    """Return all entries of a document. Operations below a site are those without, so they are left out."""
    schemas = document["components"]["schemas"]
    found = dict(_value("every error >", "", {"$ref": f"{_PREFIX}Problem"}, schemas))
    paths = document["paths"]
    for path, item in paths.items():
        if path.replace(_OF_SITE, "/api/v1/") in paths and path.startswith(_OF_SITE):
            continue
        for method in _METHODS:
            if method in item:
                found.update(_operation(f"{method.upper()} {path}", item[method], schemas))
    return dict(sorted(found.items()))


def is_asked(entry: str) -> bool:
    """Return whether clients send what the entry is about. Otherwise they receive it."""
    return " ? " in entry or " < " in entry


def _operation(name: str, operation: Json, schemas: Schemas) -> Iterator[Entry]:
    yield name, []
    for parameter in operation.get("parameters", []):
        types = _types(parameter["schema"], schemas, is_sent=True)
        place = f"{name} ? {parameter['in']} {parameter['name']}"
        yield place, types if parameter.get("required") else [*types, OPTIONAL]
    for media_type, content in operation.get("requestBody", {}).get("content", {}).items():
        yield from _value(f"{name} < {media_type}", "", content.get("schema", {}), schemas)
    for status, response in operation["responses"].items():
        if status.startswith("2"):
            yield f"{name} > {status}", []
            for media_type, content in response.get("content", {}).items():
                yield from _value(f"{name} > {status} {media_type}", "", content.get("schema", {}), schemas)


def _value(
    message: str, path: str, schema: Json, schemas: Schemas, within: frozenset[str] = frozenset()
) -> Iterator[Entry]:
    """Yield the entry of a value in a message, and those of its parts. within: the models that the value is in."""
    place = f"{message} {path}" if path else message
    yield place, _types(schema, schemas, is_asked(place))
    composed = [one for one in _alternatives(schema, schemas) if "properties" in one[1] or "items" in one[1]]
    for model, one in composed:
        if model in within:
            continue
        inner, below = within | {model} - {""}, path
        if len(composed) > 1:
            below = f"{path}{{{_kind(model, one)}}}"
            yield f"{message} {below}", []
        if "items" in one:
            yield from _value(message, f"{below}[]", one["items"], schemas, inner)
        for field, part in one.get("properties", {}).items():
            (first, types), *rest = _value(message, f"{below}.{field}", part, schemas, inner)
            yield first, types if field in one.get("required", ()) else [*types, OPTIONAL]
            yield from rest


def _alternatives(schema: Json, schemas: Schemas) -> Iterator[tuple[str, Json]]:
    """Yield each schema that a value may have, and the name of its model."""
    if "$ref" in schema:
        name = schema["$ref"].removeprefix(_PREFIX)
        yield from ((inner or name, one) for inner, one in _alternatives(schemas[name], schemas))
    elif "anyOf" in schema or "oneOf" in schema:
        for one in schema.get("anyOf", schema.get("oneOf")):
            yield from _alternatives(one, schemas)
    else:
        yield "", schema


def _kind(model: str, schema: Json) -> str:
    """Return what tells a model from the others at its place: its `type`, or else its name."""
    return str(schema.get("properties", {}).get("type", {}).get("const", model))


def _types(schema: Json, schemas: Schemas, is_sent: bool) -> list[str]:
    """Return the types of a value. is_sent: with the values that a text may have; answers may get new ones."""
    types: set[str] = set()
    for _, one in _alternatives(schema, schemas):
        values = one.get("enum", [one["const"]] if "const" in one else [])
        of_schema = one.get("type", "any")
        if is_sent and values:
            types.update(repr(value) for value in values)
        else:
            types.update(of_schema if isinstance(of_schema, list) else [of_schema])
    return sorted(types)

"""Changes of the OpenAPI document that break clients are named, and others are not."""

import json
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from dropanchor_service.api import compatibility
from dropanchor_service.api.compatibility import breaking_changes, main
from dropanchor_service.api.surface import surface_of

Json = dict[str, Any]
Change = Callable[[Json], object]


def model(*required: str, **properties: Json) -> Json:
    return {"type": "object", "properties": properties, "required": list(required)}


def ref(name: str) -> Json:
    return {"$ref": f"#/components/schemas/{name}"}


def content(schema: Json) -> Json:
    return {"content": {"application/json": {"schema": schema}}}


TEXT, NUMBER = {"type": "string"}, {"type": "number"}
KINDS = {"type": "string", "enum": ["circle", "polygon"]}
DOCUMENT: Json = {
    "paths": {
        "/zones/{zone}": {
            "put": {
                "parameters": [
                    {"in": "path", "name": "zone", "required": True, "schema": TEXT},
                    {"in": "query", "name": "dry", "schema": {"type": "boolean"}},
                ],
                "requestBody": content(ref("ZoneRequest")),
                "responses": {"200": content(ref("Zone")), "404": content(ref("Problem"))},
            }
        },
        "/zones": {
            "get": {"responses": {"200": content(model("zones", zones={"type": "array", "items": ref("Zone")}))}}
        },
    },
    "components": {
        "schemas": {
            "Problem": model("title", title=TEXT),
            "Zone": model("id", "kind", "size", id=TEXT, kind=KINDS, size={"anyOf": [NUMBER, {"type": "null"}]}),
            "ZoneRequest": model("id", id=TEXT, kind=KINDS, size=NUMBER),
        }
    },
}


def named(change: Change) -> list[str]:
    """Return what is named after the change of the document."""
    document = json.loads(json.dumps(DOCUMENT))  # no part of it is shared, as in a file
    change(document)
    return breaking_changes(surface_of(DOCUMENT), surface_of(document))


def put(document: Json) -> Json:
    operation: Json = document["paths"]["/zones/{zone}"]["put"]
    return operation


def schema(document: Json, name: str) -> Json:
    found: Json = document["components"]["schemas"][name]
    return found


BREAKING: list[tuple[Change, str]] = [
    (lambda one: one["paths"].pop("/zones"), "GET /zones: was removed"),
    (lambda one: put(one)["parameters"].pop(), "PUT /zones/{zone} ? query dry: was removed"),
    (
        lambda one: put(one)["parameters"].append({"in": "query", "name": "why", "required": True, "schema": TEXT}),
        "PUT /zones/{zone} ? query why: is new and required",
    ),
    (
        lambda one: schema(one, "ZoneRequest")["required"].append("size"),
        "PUT /zones/{zone} < application/json .size: was number or optional, is number",
    ),
    (
        lambda one: schema(one, "ZoneRequest")["properties"]["kind"]["enum"].pop(),
        "PUT /zones/{zone} < application/json .kind: was 'circle' or 'polygon' or optional, is 'circle' or optional",
    ),
    (
        lambda one: schema(one, "Zone")["properties"]["id"].update(type="integer"),
        "GET /zones > 200 application/json .zones[].id: was string, is integer",
    ),
    (
        lambda one: schema(one, "Zone")["required"].remove("kind"),
        "PUT /zones/{zone} > 200 application/json .kind: was string, is string or optional",
    ),
    (
        lambda one: schema(one, "Zone")["properties"].pop("size"),
        "GET /zones > 200 application/json .zones[].size: was removed",
    ),
]
HARMLESS: list[Change] = [
    lambda _: None,
    lambda one: one["paths"].update({"/tags": deepcopy(one["paths"]["/zones"])}),
    lambda one: put(one)["parameters"].append({"in": "query", "name": "why", "schema": TEXT}),
    lambda one: schema(one, "Zone")["properties"].update(colour=TEXT),
    lambda one: schema(one, "Zone")["properties"]["kind"]["enum"].append("line"),
    lambda one: schema(one, "ZoneRequest")["properties"]["kind"]["enum"].append("line"),
    lambda one: schema(one, "ZoneRequest")["properties"].update(names={"type": "array", "items": TEXT}),
    lambda one: schema(one, "ZoneRequest")["required"].remove("id"),
    lambda one: schema(one, "Zone")["properties"]["size"]["anyOf"].pop(),
    lambda one: schema(one, "Zone")["properties"]["size"]["anyOf"][0].update(type="integer"),
]


@pytest.mark.parametrize(("change", "sentence"), BREAKING)
def test_a_change_that_breaks_clients_is_named_with_its_place(change: Change, sentence: str) -> None:
    assert sentence in named(change)


@pytest.mark.parametrize("change", HARMLESS)
def test_a_change_with_which_every_client_goes_on_is_not_named(change: Change) -> None:
    assert named(change) == []


def test_the_interface_breaks_no_client_of_the_last_release() -> None:
    assert main(["--check"]) == 0


def test_a_breaking_change_fails_until_it_is_accepted_with_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    released, page = tmp_path / "released.json", tmp_path / "page.md"
    released.write_text('{"GET /api/v1/nothing": []}\n')
    page.write_text("# Breaking changes\n")
    monkeypatch.setattr(compatibility, "RELEASED", released)
    monkeypatch.setattr(compatibility, "PAGE", page)
    assert main(["--check"]) == main(["--release"]) == 1
    assert "GET /api/v1/nothing: was removed\n" in capsys.readouterr().err
    assert main(["--accept", " "]) == 2
    assert main(["--accept", "Nobody used it."]) == 0
    assert page.read_text().endswith("\n\nNobody used it.\n\n- `GET /api/v1/nothing: was removed`\n")
    assert main(["--check"]) == main(["--release"]) == 0

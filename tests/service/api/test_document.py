"""The OpenAPI document tells a generator of clients what requests and answers hold."""

from typing import Any

import pytest

from support.interface_document import DOCUMENT, SCHEMAS

OPERATIONS = {operation["operationId"]: operation for item in DOCUMENT["paths"].values() for operation in item.values()}
BINARY = (
    "application/octet-stream",
    "application/vnd.apache.parquet",
    "image/png",
    "application/vnd.dropanchor.samples",
)


def contents(operation: str) -> dict[str, Any]:
    """Return the schemas of an answer by media type, in the order of the document."""
    found = OPERATIONS[operation]["responses"]["200"]["content"]
    return {media_type: content["schema"] for media_type, content in found.items()}


def model(schema: dict[str, str]) -> dict[str, Any]:
    found: dict[str, Any] = SCHEMAS[schema["$ref"].rpartition("/")[2]]
    return found


@pytest.mark.parametrize(
    ("operation", "first"),
    [("export_track", "text/csv"), ("get_track", "application/json"), ("list_poses", "application/json")],
)
def test_the_default_media_type_comes_first(operation: str, first: str) -> None:
    assert next(iter(contents(operation))) == first


@pytest.mark.parametrize("operation", ["get_pose", "list_poses", "get_track", "export_track"])
def test_geojson_has_its_members(operation: str) -> None:
    geojson = model(contents(operation)["application/geo+json"])
    feature = model(geojson["properties"]["features"]["items"]) if "features" in geojson["properties"] else geojson
    assert {"type", "geometry", "properties"} <= set(feature["required"])
    assert {"t_ns", "state", "lat", "lon"} <= set(model(feature["properties"]["properties"])["properties"])


def test_what_is_binary_is_said_to_be() -> None:
    bodies = [operation.get("requestBody", {}) for operation in OPERATIONS.values()]
    answers = [response for operation in OPERATIONS.values() for response in operation["responses"].values()]
    found = {
        (media_type, content["schema"].get("format"))
        for part in (*bodies, *answers)
        for media_type, content in part.get("content", {}).items()
        if media_type in BINARY
    }
    assert found == {(media_type, "binary") for media_type in BINARY}


def test_a_request_has_no_defaults_and_an_answer_always_has_what_they_give() -> None:
    sent, got = SCHEMAS["ZoneRequest"], SCHEMAS["Zone"]
    assert sent["properties"].keys() == got["properties"].keys()
    assert sent["required"] == ["id", "shape"]
    assert {"id", "shape", "enter", "exit", "colour", "delay_s"} <= set(got["required"])
    assert sent["properties"]["enter"]["description"].endswith("The default is `true`.")
    with_default = {
        name for name, one in SCHEMAS.items() for part in one.get("properties", {}).values() if "default" in part
    }
    assert with_default == set()

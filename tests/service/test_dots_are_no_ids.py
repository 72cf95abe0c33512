"""`.` and `..` name nothing, wherever a name enters the service: they would stand for folders."""

from typing import Any

import pytest

from dropanchor_schemas.keys import PREFIX
from dropanchor_schemas.wire import encode_packed
from dropanchor_service.security.api_keys import ApiKeyError, ApiKeys
from dropanchor_service.settings.sources import SettingsError, load_settings
from service.ingest.messages import ranges
from support.api import ask, kind_of, make_api_bench
from support.ingest import IngestBench

DOTS = (".", "..")
ZONE = {"shape": {"type": "circle", "x": 1.0, "y": 2.0, "radius_m": 3.0}}
BODIES: dict[str, dict[str, Any]] = {
    "anchors/{}": {},
    "tags/{}/settings": {},
    "zones/{}": ZONE,
    "event-rules/{}": {"type": "lost", "after_s": 60.0},
    "destinations/{}": {"type": "mqtt", "topic": "yard/{tag}"},
}


@pytest.mark.parametrize("dots", DOTS)
@pytest.mark.parametrize("path", BODIES)
@pytest.mark.parametrize("escape", ["%2E", "%2e"])
def test_no_resource_of_rest_has_such_an_id(path: str, dots: str, escape: str) -> None:
    bench = make_api_bench()
    body = BODIES[path] if path.startswith("tags") else BODIES[path] | {"id": dots}
    response = ask(bench.app(), "PUT", f"/api/v1/{path.format(dots.replace('.', escape))}", json=body)
    assert kind_of(response) == "invalid-request"
    assert bench.answers.tags.find(dots) is None


@pytest.mark.parametrize("dots", DOTS)
def test_no_body_or_query_names_such_an_id(dots: str) -> None:
    app = make_api_bench().app()
    for path, body in (
        ("PUT zones/a", ZONE | {"id": "a", "tags": [dots]}),
        ("PUT site", {"anchors": [{"id": dots}]}),
        ("POST recordings", {"tags": [dots]}),
        ("POST shares", {"tag": dots}),
    ):
        method, _, name = path.partition(" ")
        assert kind_of(ask(app, method, f"/api/v1/{name}", json=body)) == "invalid-request", path
    assert kind_of(ask(app, "GET", f"/api/v1/poses?tags={dots}")) == "invalid-request"


@pytest.mark.parametrize("chunk", [".", "..", "%2E", "%2E%2E", "%2e%2e"])
def test_no_zenoh_key_names_such_a_tag(chunk: str) -> None:
    bench = IngestBench()
    for _ in range(3):
        bench.buffer.append(f"{PREFIX}/default/tag/{chunk}/samples", encode_packed(ranges(1.0)), "", 1)
    bench.send("a", ranges(1.0))
    assert bench.rejected() == {"key_invalid": 3}
    assert [tag.name for tag in bench.tags.all()] == ["a"]


@pytest.mark.parametrize("dots", DOTS)
def test_no_setting_and_no_key_names_such_an_id(dots: str, tmp_path: Any) -> None:
    refused: list[dict[str, Any]] = [
        {"tags": {dots: {}}},
        {"sites": {dots: {}}},
        {"site": {"id": dots}},
        {"site": {"anchors": [{"id": dots}]}},
        {"recording": {"tags": [dots]}},
        {"sites": {"con": {}}},
    ]
    for options in refused:
        with pytest.raises(SettingsError, match=r"cannot be an id|on Windows it is a device"):
            load_settings(options=options, environment={})
    with pytest.raises(ApiKeyError, match="cannot be an id"):
        ApiKeys(tmp_path).add_for_tag("phone", dots)

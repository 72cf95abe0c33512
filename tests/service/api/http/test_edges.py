"""Problem responses, health, metrics, the dashboard, and the OpenAPI document."""

from pathlib import Path

import pytest
from prometheus_client import Counter

from dropanchor_schemas.answers import TagList
from dropanchor_schemas.explain import Explanation
from dropanchor_schemas.pose import PoseFrame, PoseList
from dropanchor_schemas.site import Site, TagSettings
from dropanchor_service.api import export
from dropanchor_service.api.app import MAX_BODY_BYTES
from dropanchor_service.api.http.errors import Kind
from dropanchor_service.api.routes import examples
from support.api import ask, kind_of, make_api_bench
from support.interface_document import DOCUMENT, SCHEMAS


@pytest.mark.parametrize("path", ["/api/v1/nothing", "/api/v2/poses", "/nothing", "/api/v1/tags/", "/api/v1/poses/"])
def test_an_unknown_path_is_a_problem(path: str, tmp_path: Path) -> None:
    for dashboard in (None, tmp_path):
        response = ask(make_api_bench().app(dashboard), "GET", path)
        assert kind_of(response) == "not-found"
        assert response.json()["instance"] == path


@pytest.mark.parametrize(
    ("method", "path", "allow"),
    [
        ("POST", "/api/v1/anchors/1", "DELETE, GET, PUT"),
        ("DELETE", "/api/v1/site", "GET, PUT"),
        ("PATCH", "/api/v1/poses", "GET"),
        ("POST", "/metrics", "GET"),
    ],
)
def test_a_method_that_is_not_allowed_is_answered_with_those_that_are(method: str, path: str, allow: str) -> None:
    response = ask(make_api_bench().app(), method, path)
    assert kind_of(response) == "method-not-allowed"
    assert response.headers["allow"] == allow


def test_the_dashboard_is_read_only(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<!doctype html>")
    response = ask(make_api_bench().app(tmp_path), "POST", "/")
    assert kind_of(response) == "method-not-allowed"
    assert response.headers["allow"] == "GET, HEAD"


@pytest.mark.parametrize("path", ["tags", "tags/a", "site", "anchors", "anchors/17", "health/live", "health/ready"])
def test_an_unknown_query_parameter_is_refused(path: str) -> None:
    bench = make_api_bench()
    bench.answers.tags.register("a")
    app = bench.app()
    assert ask(app, "GET", f"/api/v1/{path}").status_code == 200
    assert kind_of(ask(app, "GET", f"/api/v1/{path}?verbose=1")) == "invalid-request"


def test_an_internal_error_is_a_problem_without_details() -> None:
    bench = make_api_bench()
    bench.move("a")
    bench.answers.now_ns = lambda: int("a secret")
    response = ask(bench.app(), "GET", "/api/v1/poses")
    assert kind_of(response) == "internal"
    assert "secret" not in response.text


def test_a_body_that_is_too_large_is_refused_by_its_content_length_and_by_its_size() -> None:
    app = make_api_bench().app()
    headers = {"content-type": "application/json"}
    body = b" " * (MAX_BODY_BYTES - 2) + b"{}"
    assert ask(app, "PUT", "/api/v1/tags/a/settings", content=body, headers=headers).status_code == 200
    assert kind_of(ask(app, "PUT", "/api/v1/tags/a/settings", content=b" " + body, headers=headers)) == "body-too-large"

    async def without_content_length() -> object:
        yield b" " + body

    response = ask(app, "PUT", "/api/v1/tags/a/settings", content=without_content_length(), headers=headers)
    assert kind_of(response) == "body-too-large"


def test_readiness_gives_the_reasons_when_the_service_is_not_ready() -> None:
    bench = make_api_bench()
    app = bench.app()
    assert ask(app, "GET", "/api/v1/health/live").json() == {"status": "live"}
    assert ask(app, "GET", "/api/v1/health/ready").json() == {"status": "ready", "impaired": [], "impaired_phrases": []}
    bench.not_ready = ["no Zenoh session", "disk full"]
    response = ask(app, "GET", "/api/v1/health/ready")
    assert kind_of(response) == "not-ready"
    assert response.json()["reasons"] == ["no Zenoh session", "disk full"]
    assert ask(app, "GET", "/api/v1/health/live").status_code == 200


def test_metrics_come_from_the_given_registry() -> None:
    bench = make_api_bench()
    Counter("eggs", "Eggs laid", registry=bench.registry).inc(3)
    response = ask(bench.app(), "GET", "/metrics")
    assert response.headers["content-type"].startswith("text/plain")
    assert "eggs_total 3.0" in response.text
    openmetrics = ask(bench.app(), "GET", "/metrics", headers={"accept": "application/openmetrics-text"})
    assert openmetrics.headers["content-type"].startswith("application/openmetrics-text")


def test_the_dashboard_is_revalidated_and_may_load_nothing_from_other_origins(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<!doctype html>the page")
    (tmp_path / "a.js").write_text("export {};")
    app = make_api_bench().app(tmp_path)
    page = ask(app, "GET", "/")
    assert page.text == "<!doctype html>the page"
    assert page.headers["cache-control"] == "no-cache"
    assert "default-src 'none'" in page.headers["content-security-policy"]
    script = ask(app, "GET", "/a.js")
    assert script.headers["content-type"].startswith("text/javascript")
    again = ask(app, "GET", "/a.js", headers={"if-none-match": script.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert kind_of(ask(app, "GET", "/../secret")) == "not-found"
    for path in ("/%2e%2e/secret", "/a%00b", "/" + "a" * 300):
        assert kind_of(ask(app, "GET", path)) == "not-found"
    (tmp_path / "a.js").write_text("changed = true;")
    changed = ask(app, "GET", "/a.js", headers={"if-none-match": script.headers["etag"]})
    assert (changed.status_code, changed.text) == (200, "changed = true;")


def test_the_openapi_document_is_current_and_is_what_the_service_returns() -> None:
    assert export.main(["--check"]) == 0, "run python -m dropanchor_service.api.export"
    assert ask(make_api_bench().app(), "GET", "/api/v1/openapi.json").json() == DOCUMENT


def test_every_operation_has_a_name_a_tag_a_summary_and_its_problems() -> None:
    paths, shared = DOCUMENT["paths"], DOCUMENT["components"]["responses"]
    operations = [operation for path in paths.values() for operation in path.values()]
    names = [operation["operationId"] for operation in operations]
    assert len(set(names)) == len(names) >= 16
    for operation in operations:
        assert operation["tags"]
        assert operation["summary"]
        for status, response in operation["responses"].items():
            if status == "499":  # Sensor Logger shows plain text
                continue
            described = shared[response["$ref"].split("/")[-1]] if "$ref" in response else response
            assert (status >= "400") == ("application/problem+json" in described.get("content", {}))
            assert (status >= "400") == ("$ref" in response)  # each refusal stands in the document once


def test_every_kind_of_problem_is_documented() -> None:
    description = SCHEMAS["Problem"]["description"]
    assert all(f"`{kind.type}`" in description for kind in Kind)


def test_the_examples_follow_the_contract() -> None:
    PoseList.model_validate(examples.POSE_LIST, strict=False)
    PoseFrame.model_validate(examples.POSE_FRAME)
    Explanation.model_validate(examples.EXPLANATION)
    TagList.model_validate(examples.TAG_LIST)
    TagSettings.model_validate(examples.TAG_SETTINGS)
    Site.model_validate(examples.SITE)

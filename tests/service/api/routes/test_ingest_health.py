"""Health over HTTP: who may report it for which tag, what is answered, and where it is shown."""

from pathlib import Path

import pytest

from dropanchor_schemas.answers import HealthReceived, TagStatus
from dropanchor_schemas.wire import ENCODING_JSON
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from support.api import ask, kind_of, make_api_bench

HEALTH = "/api/v1/ingest/health"
JSON = {"content-type": ENCODING_JSON}


def test_a_report_is_passed_on_as_it_is_and_its_absurd_values_are_named() -> None:
    bench = make_api_bench()
    body = b'{"battery_fraction": 0.5, "temperature_c": 999}'
    response = ask(bench.app(), "POST", f"{HEALTH}?tag=a", content=body, headers=JSON)
    assert response.status_code == 202
    answer = HealthReceived.model_validate(response.json())
    assert (answer.values, answer.absurd) == (1, ["temperature_c"])
    assert bench.received_health == [("a", body, ENCODING_JSON)]


def test_what_cannot_be_decoded_is_answered_by_its_name_and_passed_on_to_be_counted() -> None:
    bench = make_api_bench()
    response = ask(bench.app(), "POST", f"{HEALTH}?tag=a", content=b'{"battery": 1}', headers=JSON)
    assert (response.status_code, kind_of(response)) == (422, "health-rejected")
    assert response.json()["reason"] == "json_schema"
    assert len(bench.received_health) == 1


def test_the_key_of_a_tag_reports_for_this_tag_only_and_no_other_key_reports(tmp_path: Path) -> None:
    keys, bench = ApiKeys(tmp_path), make_api_bench()
    anna, writer = keys.add_for_tag("anna's phone", "anna"), keys.add("writer", Scope.WRITE)
    app = bench.app(authenticator=Authenticator({SOURCE: keys}))

    def status(secret: str, query: str = "") -> int:
        headers = JSON | {"authorization": f"Bearer {secret}"}
        return ask(app, "POST", f"{HEALTH}{query}", headers=headers, content=b'{"battery_v": 3.7}').status_code

    assert status(anna) == status(anna, "?tag=anna") == 202
    assert status(anna, "?tag=ben") == status(writer, "?tag=anna") == 403
    assert status("wrong") == 401
    assert [tag for tag, _, _ in bench.received_health] == ["anna", "anna"]


def test_the_status_of_a_tag_has_its_health_with_its_age_and_what_it_needs() -> None:
    bench = make_api_bench()
    row = bench.answers.tags.register("a").row
    bench.answers.tags.register("b")
    bench.answers.health.record(row, {"battery_fraction": 0.125, "firmware": "1.0"}, bench.now_ns - 2_500_000_000)
    app = bench.app()
    status = TagStatus.model_validate(ask(app, "GET", "/api/v1/tags/a").json())
    assert status.health is not None
    assert status.health.model_dump(exclude_none=True) == {
        "age_s": pytest.approx(2.5),
        "battery_fraction": 0.125,
        "firmware": "1.0",
    }
    assert [care.reason for care in status.needs_care] == ["battery_low"]
    other = TagStatus.model_validate(ask(app, "GET", "/api/v1/tags/b").json())
    assert (other.health, other.needs_care) == (None, [])

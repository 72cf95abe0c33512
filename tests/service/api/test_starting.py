"""Until the service is ready, it serves the page, and every other answer says what it still does."""

import pytest

from dropanchor_service.api.starting import Gate, create_starting_app
from dropanchor_service.metrics.cluster import ClusterGauges
from support.api import ask, kind_of

REASON = "The service compiles the estimator on this machine: 7 s so far."
APP = create_starting_app(lambda: REASON)


def test_the_page_and_its_files_are_there() -> None:
    assert "<title>Dropanchor</title>" in ask(APP, "GET", "/").text
    assert ask(APP, "GET", "/page/main.js").status_code == 200


def test_the_service_is_live_but_not_ready() -> None:
    assert ask(APP, "GET", "/api/v1/health/live").json()["status"] == "live"
    response = ask(APP, "GET", "/api/v1/health/ready")
    assert (response.status_code, kind_of(response)) == (503, "not-ready")
    assert response.json()["reasons"] == [REASON]


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/api/v1/poses"),
        ("GET", "/api/v1/stream"),
        ("PUT", "/api/v1/site"),
        ("POST", "/api/v1/ingest/a%2Fb"),
        ("DELETE", "/api/v1/anchors/1"),
        ("GET", "/metrics"),
        ("GET", "/omlox/v2/trackables"),
    ],
)
def test_everything_else_says_what_the_service_still_does(method: str, path: str) -> None:
    response = ask(APP, method, path)
    assert (response.status_code, kind_of(response)) == (503, "not-ready")
    assert response.json()["detail"] == REASON
    assert response.headers["retry-after"] == "1"


def test_a_standby_shows_its_own_metrics_and_the_gate_opens_and_closes_with_each_request() -> None:
    standby = create_starting_app(lambda: REASON, gauges=ClusterGauges("yard", lambda: None))
    assert 'dropanchor_cluster_owner{bucket="yard"} 0.0' in ask(standby, "GET", "/metrics").text
    owner = create_starting_app(lambda: "", gauges=ClusterGauges("yard", lambda: (4, 0.3)))
    answers = iter([False, True, False])
    gate = Gate(lambda: next(answers), owner, standby)
    texts = [ask(gate, "GET", "/metrics").text for _ in range(3)]  # type: ignore[arg-type]
    assert ['dropanchor_cluster_epoch{bucket="yard"} 4.0' in text for text in texts] == [False, True, False]
    assert 'dropanchor_cluster_lease_age_seconds{bucket="yard"} 0.3' in texts[1]

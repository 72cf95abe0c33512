"""Clients in TypeScript and Python that are generated as the guide says, against a real service with a tag."""

import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from dropanchor_schemas.pose import TrackingState
from support.guides import blocks_of, follow
from support.node_packages import install
from support.service import Running
from support.yard import running_yard

GUIDE, TAG = "generate-a-client.md", "forklift-7"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running_yard(tmp_path_factory.mktemp("service"), TAG) as running:
        yield running


def assert_answered(said: str, service: Running) -> dict[str, Any]:
    """Check what a program has printed of its ten requests."""
    answers: dict[str, Any] = json.loads(said.splitlines()[-1])
    assert answers["site"] == "default"
    assert answers["online"] in ([True], [False])  # the tag is silent: it goes offline some time, and its pose ages
    assert [state in [*TrackingState] for state in answers["states"]] == [True]
    ((lon, lat, alt),) = answers["places"]
    assert (lon, lat) == pytest.approx((13.4, 52.5), abs=0.001)
    assert alt == 34.0
    assert answers["time"] == service.get(f"/api/v1/tags/{TAG}/pose")["t_utc"]
    assert 0 < answers["track"] <= len(service.get(f"/api/v1/tags/{TAG}/track")["poses"])  # more may be stored since
    assert answers["columns"][:3] == ["t_ns", "t_utc", "state"]
    assert answers["colour"] == service.get("/api/v1/zones/dock")["colour"]
    assert isinstance(answers["events"], list)
    assert answers["refused"].startswith("Without access control everybody sees everything")
    return answers


@pytest.mark.parametrize("generator", ["openapi-typescript", "hey-api"])
def test_a_typescript_client_made_by_the_guide_asks_ten_usual_requests(
    generator: str, service: Running, tmp_path: Path
) -> None:
    blocks = blocks_of(GUIDE, f"TypeScript with {generator}")
    (line,) = [line for line in blocks[0].text.splitlines() if line.startswith("npm install --silent ")]
    install(tmp_path, *line.split()[3:])  # skips without npm
    assert_answered(follow(blocks, tmp_path, service.url), service)


def test_a_python_client_made_by_the_guide_asks_ten_usual_requests(service: Running, tmp_path: Path) -> None:
    blocks = blocks_of(GUIDE, "Python with openapi-python-client")
    assert f"openapi-python-client=={version('openapi-python-client')} " in blocks[0].text  # pip changes nothing
    answers = assert_answered(follow(blocks, tmp_path, service.url), service)
    assert answers["parquet"] > 1000

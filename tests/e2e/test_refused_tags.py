"""Whoever sends samples over HTTP for a tag that the site does not admit is told so, and not thanked for them."""

import json
from collections.abc import Iterator

import pytest
from websockets.sync.client import connect

from support.patience import PATIENCE_S
from support.service import Running, running_service

SAMPLES = {"clock": "boot", "boot_id": 7, "range": [{"t_ns": 1_000_000_000, "anchor": 1, "range_m": 3.0}]}


@pytest.fixture(
    scope="module", params=[("refuse", "tag_unknown"), ("quarantine", "tag_quarantined")], ids=lambda p: p[0]
)
def refusing(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Running, str]]:
    policy, reason = request.param
    settings = tmp_path_factory.mktemp("settings") / "dropanchor.toml"
    settings.write_text(f'unknown_tags = "{policy}"\n[tags.listed]\n')
    with running_service("--engine", "paper", "--config", str(settings)) as service:
        yield service, reason


@pytest.mark.parametrize(("tag", "is_refused"), [("listed", False), ("stranger", True)])
def test_samples_of_a_tag_are_acknowledged_only_if_its_site_admits_it(
    tag: str, is_refused: bool, refusing: tuple[Running, str]
) -> None:
    service, reason = refusing
    answer = service.ask("POST", f"/api/v1/ingest/samples?tag={tag}", json=SAMPLES)
    assert answer.status_code == (422 if is_refused else 202), answer.text
    assert answer.json().get("reason") == (reason if is_refused else None)
    stream = f"{service.url}/api/v1/ingest/stream?tag={tag}".replace("http", "ws", 1)
    with connect(stream, subprotocols=["dropanchor.samples"], open_timeout=PATIENCE_S) as socket:  # type: ignore[list-item]
        socket.recv(PATIENCE_S)
        socket.send(json.dumps(SAMPLES | {"boot_id": 8}))
        assert json.loads(socket.recv(PATIENCE_S))["rejected"] == (reason if is_refused else None)


def test_a_tag_is_told_nothing_of_that_once_an_operator_admits_it(refusing: tuple[Running, str]) -> None:
    service, _ = refusing
    service.ask("PUT", "/api/v1/tags/new/settings", json={}).raise_for_status()
    assert service.ask("POST", "/api/v1/ingest/samples?tag=new", json=SAMPLES).status_code == 202

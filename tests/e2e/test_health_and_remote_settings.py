"""A tag reports its health to a real service, and the service sets how the tag's program sends."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from dropanchor_tag_client import TagClient, Upkeep
from support.service import Running, running_service
from support.zenoh_router import wait_until

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder: Path = tmp_path_factory.mktemp("data")
    with running_service("--data-dir", str(folder)) as running:
        yield running


def patch(service: Running, tag: str, body: object, **headers: str) -> httpx.Response:
    return service.ask("PATCH", f"/api/v1/tags/{tag}/remote-settings", json=body, headers=headers)


def status_of(service: Running, tag: str) -> dict[str, Any]:
    found = service.ask("GET", f"/api/v1/tags/{tag}")
    return found.json() if found.status_code == 200 else {"health": None}


def acknowledged(service: Running, tag: str) -> Any:
    return status_of(service, tag)["remote_settings"]["acknowledged"]


def test_health_over_zenoh_and_http_is_shown_and_bad_values_are_counted(service: Running) -> None:
    with TagClient("a", connect=service.zenoh) as tag, Upkeep([tag], lambda: {"battery_fraction": 0.1}):
        wait_until(lambda: status_of(service, "a")["health"])
    body = {"rssi_dbm": -70.0, "temperature_c": 5000}
    assert service.ask("POST", "/api/v1/ingest/health?tag=a", json=body).status_code == 202
    wait_until(lambda: "rssi_dbm" in status_of(service, "a")["health"])
    status = status_of(service, "a")
    assert status["health"].keys() == {"age_s", "battery_fraction", "rssi_dbm"}
    assert status["rejected"] == {"health_absurd": 1}
    assert [care["reason"] for care in status["needs_care"]] == ["battery_low"]
    assert service.metric('dropanchor_tags_needing_care{reason="battery_low"}') == 1


def test_settings_reach_a_program_at_its_start_and_on_change_and_are_acknowledged(service: Running) -> None:
    service.put("/api/v1/tags/b/settings", {})
    assert patch(service, "b", {"batch_s": 5.0}).status_code == 200
    with TagClient("b", connect=service.zenoh, batch_samples=1) as tag, Upkeep([tag]):
        wait_until(lambda: acknowledged(service, "b") == {"batch_s": 5.0})
        for _ in range(50):
            tag.publish_range(1, 1.0)
        assert tag.sent.messages == 1
        changed = patch(service, "b", {"batch_s": None, "imu_hz": 10}).json()
        assert changed["wanted"] == {"batch_s": None, "imu_hz": 10.0}
        wait_until(lambda: acknowledged(service, "b") == {"imu_hz": 10.0})
        before = tag.sent.samples
        for i in range(101):
            tag.publish_imu((0.0, 0.0, 9.81), (0.0, 0.0, 0.1), t_ns=SECOND + i * SECOND // 100)
        assert tag.sent.samples - before == 10


def test_a_patch_changes_only_what_it_names_and_only_what_its_sender_has_seen(service: Running) -> None:
    service.put("/api/v1/tags/c/settings", {})
    first = service.ask("GET", "/api/v1/tags/c/remote-settings").headers["etag"]
    second = patch(service, "c", {"imu_hz": 50}, **{"if-match": first})
    assert second.json()["wanted"] == {"batch_s": None, "imu_hz": 50.0}
    assert patch(service, "c", {"imu_hz": 20}, **{"if-match": first}).status_code == 412
    third = patch(service, "c", {"batch_s": 1}, **{"if-match": second.headers["etag"]})
    assert third.json()["wanted"] == {"batch_s": 1.0, "imu_hz": 50.0}
    for body, says in (({"imu_hz": 0}, "body.imu_hz"), ({"hz": 1}, "body.hz"), ({"batch_s": "1"}, "body.batch_s")):
        refused = patch(service, "c", body)
        assert (refused.status_code, says in refused.text) == (422, True)
    assert patch(service, "nobody", {"imu_hz": 5}).status_code == 404

"""A backup of a running service, made and restored with the lines of the guide, brings back what it had."""

from pathlib import Path

from dropanchor_schemas import keys
from dropanchor_schemas.wire import ENCODING_PACKED, encode_packed
from support.guides import blocks_of, follow
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import connected_session, wait_until

GUIDE = "back-up.md"
WRITTEN = 'dropanchor_checkpoints_total{outcome="written"}'
ZONE = {"id": "dock", "shape": {"type": "circle", "x": 0.0, "y": 0.0, "radius_m": 5.0}}


def past(service: Running) -> list[int]:
    answer = service.ask("GET", "/api/v1/tags/a/track")
    return [pose["t_ns"] for pose in answer.json()["poses"]] if answer.status_code == 200 else []


def test_the_lines_of_the_guide_back_up_a_running_service_and_restore_it(tmp_path: Path) -> None:
    options = ("--config", str(settings_file(tmp_path, ["a"])), "--data-dir", str(tmp_path / "data"))
    with running_service(*options) as service, connected_session(service.zenoh) as session:
        service.put("/api/v1/zones/dock", ZONE)
        written = service.metric(WRITTEN)
        session.put(keys.samples_key("default", "a"), encode_packed(straight_north(30)), encoding=ENCODING_PACKED)
        wait_until(lambda: past(service) and service.metric(WRITTEN) > written)
        before = past(service)
        assert "every file was read again" in follow(blocks_of(GUIDE, ""), tmp_path, service.url)
        service.ask("DELETE", "/api/v1/zones/dock").raise_for_status()
    assert "restored: data" in follow(blocks_of(GUIDE, "Restore"), tmp_path, "")
    with running_service(*options) as service:
        assert "dock" in {zone["id"] for zone in service.get("/api/v1/zones")["zones"]}
        assert past(service)[: len(before)] == before
        assert service.get("/api/v1/tags/a")["messages"] == 1
        assert service.get("/api/v1/health/ready")["impaired"] == []

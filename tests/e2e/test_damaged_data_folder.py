"""A service starts with a damaged data folder, serves what is good, and says what is not."""

import signal
from pathlib import Path

import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.wire import ENCODING_PACKED, encode_packed
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import connected_session, wait_until

WRITTEN = 'dropanchor_checkpoints_total{outcome="written"}'
ZONE = {"id": "dock", "shape": {"type": "circle", "x": 0.0, "y": 0.0, "radius_m": 5.0}}


def send(service: Running, session: zenoh.Session) -> None:
    """Publish samples, and wait for the next checkpoint."""
    before = service.metric(WRITTEN)
    session.put(keys.samples_key("default", "a"), encode_packed(straight_north(30)), encoding=ENCODING_PACKED)
    wait_until(lambda: service.metric(WRITTEN) > before)


def test_a_service_with_a_damaged_data_folder_serves_what_is_good_and_names_the_rest(tmp_path: Path) -> None:
    data = tmp_path / "data"
    options = ("--config", str(settings_file(tmp_path, ["a"], 'engine = "fleet"')), "--data-dir", str(data))
    with running_service(*options) as service, connected_session(service.zenoh) as session:
        service.put("/api/v1/zones/dock", ZONE)
        service.put("/api/v1/tags/a/settings", {"name": "Fork"})
        for _ in range(4):  # the last two checkpoints have the tag
            send(service, session)
        wait_until(lambda: service.metric("dropanchor_history_poses_total") > 0)
        assert service.get("/api/v1/health/ready")["impaired"] == []
        service.stop(signal.SIGKILL)
    newest = max((data / "checkpoints").iterdir())
    for path in (data / "zones.json", data / "site.json", newest):
        path.write_bytes(path.read_bytes()[:-40])
    for companion in data.glob("history.sqlite-*"):
        companion.unlink()
    (data / "history.sqlite").write_bytes(b"?" * 4096)
    with running_service(*options) as service:
        impaired = service.get("/api/v1/health/ready")["impaired"]
        for sentence in (
            "site.json is damaged; its last good copy is used: look at site.json.damaged-",
            "zones.json is damaged; its last good copy is used: look at zones.json.damaged-",
            "history.sqlite is damaged (file is not a database); a new history was started: look at history.sqlite.dam",
            f"checkpoints/{newest.name} is damaged; the one before is used, or else all tags start afresh: look at ",
        ):
            assert [one for one in impaired if one.startswith(sentence)] != [], impaired
        assert [zone["id"] for zone in service.get("/api/v1/zones")["zones"]] == ["dock"]
        assert service.get("/api/v1/tags/a/settings")["name"] == "Fork"
        assert service.get("/api/v1/tags/a/pose")["range_m"] is not None
        for aside in [*data.glob("*.damaged-*"), *data.glob("checkpoints/*.damaged-*")]:
            aside.unlink()
        assert service.get("/api/v1/health/ready")["impaired"] == []

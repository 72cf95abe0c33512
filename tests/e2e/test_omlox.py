"""An omlox client follows simulated tags through a real service, and what it stored survives a kill."""

import signal
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from dropanchor_service.api.omlox.models import FenceEvent, TrackableMotion
from support.live_tags import LiveTags
from support.omlox import Socket, socket_to
from support.patience import PATIENCE_S
from support.service import Running, running_service
from support.zenoh_router import free_endpoint

BASE = "/omlox/v2"


def test_a_client_follows_tags_and_a_fence_and_finds_its_objects_after_a_kill(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    tags = LiveTags(endpoint, tags=2, seed=3)
    settings = ("--config", str(tags.write_settings(tmp_path)), "--data-dir", str(tmp_path / "data"))
    with running_service(*settings, endpoint=endpoint) as service, tags:
        (zone,) = service.get(f"{BASE}/zones")
        yard = {"region": {"type": "Point", "coordinates": [0, 0]}, "radius": 500, "crs": "local", "zone_id": zone}
        fence = service.ask("POST", f"{BASE}/fences", json=yard | {"properties": {"owner": "north"}}).json()["id"]
        with socket_to(urlsplit(service.url).port or 0) as socket:
            socket.subscribe("fence_events", fence_id=fence)
            event = FenceEvent.model_validate(first(socket, "fence_events"))
            socket.subscribe("trackable_motions")
            motion = TrackableMotion.model_validate(first(socket, "trackable_motions"))
        assert event.event_type == "region_entry"
        assert str(event.trackable_id) in service.get(f"{BASE}/trackables")
        assert motion.location.crs == "local"
        body = {"type": "omlox", "name": "Forklift", "properties": {"fleet": "north"}}
        assert service.ask("PUT", f"{BASE}/trackables/{motion.id}", json=body).status_code == 200
        service.stop(signal.SIGKILL)
    with running_service(*settings) as again:
        assert_stored(again, str(motion.id), fence)


def first(socket: Socket, topic: str) -> Any:
    """Return the first object of a topic."""
    while True:
        message = socket.next(PATIENCE_S)
        if message["topic"] == topic:
            return message["payload"][0]


def assert_stored(service: Running, trackable: str, fence: str) -> None:
    found = service.get(f"{BASE}/trackables/{trackable}")
    assert (found["name"], found["properties"]["fleet"]) == ("Forklift", "north")
    tag = found["location_providers"][0]
    assert service.get(f"/api/v1/tags/{tag}/settings")["name"] == "Forklift"
    assert service.get(f"{BASE}/fences/{fence}")["properties"]["owner"] == "north"
    assert service.get(f"/api/v1/zones/{fence}")["shape"]["radius_m"] == 500

"""A service with the packages of the core alone: what only an extra installs is not there."""

import sys

import pytest

from dropanchor_tag_client import TagClient
from release.needs import packages
from service.test_optional_packages import COMMAND, without
from support.service import running_service
from support.zenoh_router import wait_until

IMPORTED_AS = {"foxglove-sdk": "foxglove", "paho-mqtt": "paho"}
SHARED = {"attrs"}  # an import of the core may find it; nothing of ours needs it


def only_in_extras() -> list[str]:
    """Return the packages to import that no core installation has."""
    names = [one.name for one in packages() if one.extras and one.name not in SHARED]
    return [IMPORTED_AS.get(name, name.replace("-", "_")) for name in names]


def test_the_service_runs_without_any_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    absent = only_in_extras()
    assert {
        "pmtiles",
        "pypdfium2",
        "pyproj",
        "paho",
        "psycopg",
        "pyarrow",
        "ray",
        "rosbags",
        "resvg_py",
        "s3fs",
    } <= set(absent)
    program = [sys.executable, "-c", without(*absent) + COMMAND]
    monkeypatch.setattr("support.service.command", lambda *arguments: [*program, *arguments])
    with running_service() as service:
        for page in ("/", "/docs/", "/api/v1/basemap", "/api/v1/destinations", "/metrics"):
            assert service.ask("GET", page).status_code == 200, page
        with TagClient("cart", connect=service.zenoh) as tag:
            for number in range(20):
                tag.publish_range(1, 5.0 + 0.01 * number)
                tag.publish_imu(acc=(0.0, 0.0, 9.81), gyro=(0.0, 0.0, 0.1))
            tag.flush()
            wait_until(lambda: service.ask("GET", "/api/v1/tags/cart/pose").status_code == 200)
        assert service.get("/api/v1/tags/cart/pose")["state"] == "initialising"
        assert service.stop() == 0

"""A served site and the browsers around it: names, origins, and who may read its files."""

import json
import socket
import stat
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin

from support.patience import PATIENCE_S
from support.service import Running, running_service

EVIL = "https://evil.example"
PHONE = json.dumps({"messageId": 1, "sessionId": "s", "deviceId": "d", "payload": []})


def status(service: Running, method: str, path: str, **headers: str) -> int:
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return service.ask(method, f"/api/v1/{path}", headers=named, content=PHONE).status_code


def test_pages_of_others_reach_nothing_of_a_service_without_keys_and_its_files_are_private(tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o755)
    with running_service("--data-dir", str(data)) as service:
        port = service.url.rpartition(":")[2]
        assert status(service, "GET", "poses", host=f"localhost:{port}") == 200
        for path in ("poses", "tags", "health/ready", "openapi.json"):
            assert status(service, "GET", path, host=f"evil.example:{port}") == 421
        assert service.ask("GET", "/", headers={"host": "evil.example"}).status_code == 421
        assert status(service, "POST", "ingest/sensor-logger?tag=a", origin=EVIL, content_type="text/plain") == 403
        assert status(service, "PUT", "tags/a/settings", host="evil.example", origin="http://evil.example") == 421
        assert service.get("/api/v1/tags")["tags"] == []
        service.put("/api/v1/tags/a/settings", {})
        _refuses_a_foreign_feed(service)
        modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in [data, *data.rglob("*")]}
    assert modes["data"] == 0o700
    assert {"site.json"} <= set(modes)
    assert all(mode & 0o077 == 0 for mode in modes.values()), modes


def _refuses_a_foreign_feed(service: Running) -> None:
    url = f"{service.url.replace('http', 'ws', 1)}/omlox/v2/ws/socket"
    with (
        connect(url, origin=Origin(EVIL), proxy=None) as page,
        pytest.raises(ConnectionClosed, match=r"http\.cors_origins"),
    ):
        page.recv(PATIENCE_S)


def test_a_service_for_the_network_has_its_addresses_its_name_and_those_of_the_settings(tmp_path: Path) -> None:
    config = tmp_path / "yard.toml"
    config.write_text('[http]\nallowed_hosts = ["yard.example"]\n')
    with running_service("--config", str(config), "--host", "0.0.0.0", "--insecure") as service:
        service.url = service.url.replace("0.0.0.0", "127.0.0.1")
        name = socket.gethostname().partition(".")[0]
        for host in ("192.168.1.7:8080", name, f"{name}.local:8080", "yard.example"):
            assert status(service, "GET", "poses", host=host) == 200
            own = f"http://{host}"
            assert status(service, "POST", "ingest/sensor-logger?tag=a", host=host, origin=own) not in (403, 421)
        refused = service.ask("GET", "/api/v1/poses", headers={"host": "other.example"})
        assert refused.status_code == 421
        assert "'other.example'" in refused.json()["detail"]
        assert "`allowed_hosts` in `[http]`" in refused.json()["detail"]

"""Pages of other origins neither change, nor feed, nor open a WebSocket, and a turned name reaches nothing."""

from collections.abc import Mapping
from pathlib import Path
from threading import Event
from typing import Any

import pytest
from fastapi import FastAPI
from starlette.types import Receive, Scope, Send
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from dropanchor_service.api.http.borders import Border, Borders, border_of
from dropanchor_service.api.http.hosts import Hosts
from dropanchor_service.api.http.of_cluster import SECRET, FromNodes
from dropanchor_service.api.routes import examples
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.security.identity import Authenticator
from dropanchor_service.security.identity import Scope as AccessScope
from dropanchor_service.security.issued import Table
from dropanchor_service.security.own_hosts import own_hosts
from dropanchor_service.settings.http import HttpSettings
from dropanchor_service.store.omlox_items import OmloxItems
from support.api import ApiBench, ask, kind_of, make_api_bench
from support.http_server import running_server
from support.patience import PATIENCE_S

EVIL = "https://evil.example"
MAP = "https://map.example"
FEEDS = [
    ("POST", "/api/v1/ingest/samples?tag=a"),
    ("POST", "/api/v1/ingest/sensor-logger?tag=a"),
    ("POST", "/api/v1/ingest/phyphox?tag=a"),
    ("POST", "/api/v1/ingest/health?tag=a"),
]
CHANGES = [
    ("PUT", "/api/v1/tags/a/settings"),
    ("DELETE", "/api/v1/tags/a"),
    ("POST", "/api/v1/recordings"),
    ("POST", "/api/v1/plan-images"),
    ("PUT", "/omlox/v2/providers/locations"),
    ("POST", "/omlox/v2/trackables"),
    ("DELETE", "/omlox/v1/fences"),
]


def bench_and_app(cors_origins: tuple[str, ...] = ()) -> tuple[ApiBench, FastAPI]:
    bench = make_api_bench()
    return bench, bench.app(omlox=OmloxItems.opened(None), cors_origins=cors_origins)


def behind(border: Border) -> Any:
    """Return an application that answers `204` to everything behind the border."""

    async def answer(_scope: Scope, _receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 204, "headers": []})
        await send({"type": "http.response.body"})

    return Borders(answer, border)


@pytest.mark.parametrize(("method", "path"), [*FEEDS, *CHANGES])
@pytest.mark.parametrize("content_type", ["text/plain", "application/json", ""])
@pytest.mark.parametrize(
    "sent",
    [
        {"origin": EVIL},
        {"origin": "null"},
        {"origin": "http://["},
        {"origin": "http://test:81"},
        {"origin": EVIL, "sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
)
def test_no_page_of_another_origin_changes_or_feeds_anything(
    method: str, path: str, content_type: str, sent: Mapping[str, str], kept: tuple[ApiBench, FastAPI]
) -> None:
    bench, app = kept
    refused = ask(app, method, path, headers={**sent, "content-type": content_type}, content=b'{"payload": []}')
    assert kind_of(refused) == "other-origin"
    assert "`cors_origins`" in refused.json()["detail"]
    assert bench.received == bench.received_health == []


@pytest.fixture(scope="module")
def kept() -> tuple[ApiBench, FastAPI]:
    return bench_and_app()


@pytest.mark.parametrize(
    "sent",
    [
        {},
        {"origin": "http://test"},
        {"origin": "https://test"},
        {"origin": MAP},
        {"origin": "https://yard.example", "sec-fetch-site": "same-origin"},
        {"origin": "https://yard.example", "x-forwarded-host": "yard.example"},
        {"sec-fetch-site": "none"},
        {"sec-fetch-site": "same-origin"},
    ],
)
def test_programs_own_pages_and_listed_origins_change_and_feed(sent: Mapping[str, str]) -> None:
    bench, app = bench_and_app((MAP,))
    assert ask(app, "PUT", "/api/v1/tags/a/settings", json={}, headers=dict(sent)).status_code == 200
    samples = ask(app, "POST", "/api/v1/ingest/samples?tag=a", json=examples.SAMPLES, headers=dict(sent))
    assert samples.status_code == 202
    assert len(bench.received) == 1


def test_a_page_of_another_origin_with_a_key_is_let_in_where_its_origin_is_listed(tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    secret = keys.add("writer", AccessScope.WRITE)
    for origins, status in (((MAP,), 200), (("*",), 200), ((), 403)):
        app = make_api_bench().app(authenticator=Authenticator({SOURCE: keys}), cors_origins=origins)
        headers = {"authorization": f"Bearer {secret}", "origin": MAP}
        assert ask(app, "PUT", "/api/v1/tags/a/settings", json={}, headers=headers).status_code == status


def test_only_reading_needs_no_origin_and_its_answer_is_for_no_other_page() -> None:
    answer = ask(bench_and_app()[1], "GET", "/api/v1/poses", headers={"origin": EVIL, "sec-fetch-site": "cross-site"})
    assert answer.status_code == 200
    assert answer.headers["cross-origin-resource-policy"] == "same-origin"
    assert "access-control-allow-origin" not in answer.headers


@pytest.mark.parametrize("path", ["/omlox/v2/ws/socket", "/api/v1/ingest/stream?tag=a", "/nowhere"])
@pytest.mark.parametrize("with_keys", [False, True])
def test_no_page_of_another_origin_opens_a_web_socket(path: str, with_keys: bool, tmp_path: Path) -> None:
    authenticator = Authenticator({SOURCE: ApiKeys(tmp_path)}) if with_keys else None
    app = make_api_bench().app(authenticator=authenticator, omlox=OmloxItems.opened(None))
    with running_server(app, Event()) as port:
        offered = [Subprotocol("dropanchor.samples")]
        for origin in (EVIL, f"http://localhost:{port}"):
            with (
                connect(
                    f"ws://127.0.0.1:{port}{path}",
                    origin=Origin(origin),
                    subprotocols=offered,
                    proxy=None,
                ) as socket,
                pytest.raises(ConnectionClosed) as closed,
            ):
                socket.recv(PATIENCE_S)
            assert closed.value.rcvd is not None
            assert (closed.value.rcvd.code, "cors_origins" in closed.value.rcvd.reason) == (4403, True)


LOCAL = border_of(HttpSettings(), None)
LAN = border_of(HttpSettings(host="0.0.0.0"), None)
NAMED = border_of(HttpSettings(allowed_hosts=("Yard.Example", "*.dock.example")), None)


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8080", "localhost.evil.example", "127.0.0.1.evil.example", "", "a@localhost"]
)
def test_a_name_that_the_service_does_not_have_reaches_nothing(host: str) -> None:
    for border in (LOCAL, LAN, NAMED):
        for headers in ({"host": host}, {"host": "localhost", "x-forwarded-host": host}):
            refused = ask(behind(border), "GET", "/", headers=headers)
            assert kind_of(refused) == "other-host"
            assert refused.status_code == 421
            assert "add it to `allowed_hosts` in `[http]`" in refused.json()["detail"]


@pytest.mark.parametrize(
    "host",
    [
        "localhost",
        "LOCALHOST:8080",
        "localhost.",
        "127.0.0.1:8080",
        "[::1]:8080",
        "192.168.1.7:8080",
        "[fe80::1]",
        "8.8.8.8",
    ],
)
def test_the_loopback_and_every_address_are_its_names(host: str) -> None:
    for border in (LOCAL, LAN, NAMED):
        assert ask(behind(border), "GET", "/", headers={"host": host}).status_code == 204


def test_the_names_of_the_settings_are_its_names_and_pages_there_are_its_own() -> None:
    app = behind(NAMED)
    for host in ("yard.example", "YARD.EXAMPLE:443", "east.dock.example"):
        assert ask(app, "GET", "/", headers={"host": host}).status_code == 204
        proxied = {"host": "127.0.0.1:8080", "origin": f"https://{host.lower()}"}
        assert ask(app, "PUT", "/", headers=proxied).status_code == 204
    assert ask(app, "GET", "/", headers={"host": "dock.example"}).status_code == 421
    everything = behind(border_of(HttpSettings(allowed_hosts=("*",)), None))
    assert ask(everything, "GET", "/", headers={"host": "evil.example"}).status_code == 204
    foreign = {"host": "localhost", "origin": EVIL}
    assert ask(everything, "PUT", "/", headers=foreign).status_code == 403


def test_beyond_the_loopback_the_machine_has_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("socket.gethostname", lambda: "pit.yard.example")
    listening = Hosts(own_hosts(HttpSettings(host="0.0.0.0"), None))
    assert all(listening.allows(name) for name in ("pit", "pit.local:8080", "pit.yard.example"))
    assert not listening.allows("yard.example")
    assert not any(Hosts(own_hosts(HttpSettings(), None)).allows(name) for name in ("pit", "pit.local"))
    assert Hosts(own_hosts(HttpSettings(host="dock.example"), None)).allows("dock.example:8080")


def test_the_names_in_certificates_are_its_names(tmp_path: Path) -> None:
    table = Table(site="default", hosts=("yard.example", "192.0.2.1"), listen=("tls/0.0.0.0:7447",))
    folder = SecurityFolder.make(tmp_path / "security", table, days=30)
    assert Hosts(own_hosts(HttpSettings(), folder)).allows("yard.example")
    files = {"certificate": folder.certificate("service"), "key": folder.key("service")}
    assert Hosts(own_hosts(HttpSettings.model_validate(files), None)).allows("yard.example")


def test_what_a_node_passes_on_was_checked_by_the_node() -> None:
    app: Any = FromNodes(behind(LOCAL), b"a secret of the tests")
    of_client = {"host": "owner.internal", "x-forwarded-host": "yard.example", "origin": "https://other.example"}
    assert ask(app, "PUT", "/", headers=of_client | {SECRET: "a secret of the tests"}).status_code == 204
    assert ask(app, "PUT", "/", headers=of_client | {SECRET: "guessed"}).status_code == 403
    assert ask(app, "PUT", "/", headers=of_client).status_code == 421

"""The service below a path of nginx and of Caddy, with TLS, as the guide sets them up."""

import json
import ssl
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect
from websockets.sync.client import connect

from support.browser import PausedBrowser
from support.patience import PATIENCE_S
from support.proxies import caddy, nginx, of_guide
from support.service import ended, running_service
from support.zenoh_router import free_port, wait_until

Proxy = Callable[[Path, str], AbstractContextManager[tuple[str, Path]]]


@dataclass
class Proxied:
    """A secured service behind a proxy. client: asks for what is below the path, with the key of an operator."""

    service: str
    address: str
    client: httpx.Client
    tls: ssl.SSLContext
    tag_key: str

    def get(self, path: str) -> httpx.Response:
        return self.client.get(f"{self.address}/rtls{path}", follow_redirects=True)


@pytest.fixture(scope="module", params=[nginx, caddy], ids=["nginx", "caddy"])
def proxied(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Proxied]:
    tmp_path, start = tmp_path_factory.mktemp("yard"), request.param
    security = ["--security", str(tmp_path / "security")]

    def made(*words: str) -> str:
        done = ended(*words, *security)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    made("security", "init", "--host", "localhost", "--listen", f"tls/127.0.0.1:{free_port()}")
    made("tag", "add", "a/b")
    admin, tag_key = made("key", "add", "page", "--scope", "admin"), made("key", "add", "cart", "--tag", "a/b")
    (tmp_path / "yard.toml").write_text(of_guide("toml"))
    options = ["--config", str(tmp_path / "yard.toml"), "--data-dir", str(tmp_path / "data")]
    listen = f"tls/127.0.0.1:{free_port()}"
    with (
        running_service(*options, *security, "--zenoh-listen", listen, ready=False) as service,
        start(tmp_path, service.url.removeprefix("http://")) as (address, certificate),
    ):
        tls = ssl.create_default_context(cafile=certificate)
        with httpx.Client(verify=tls, trust_env=False, headers={"authorization": f"Bearer {admin}"}) as client:
            place = Proxied(service.url, address, client, tls, tag_key)
            wait_until(lambda: is_ready(place))
            yield place


def is_ready(place: Proxied) -> bool:
    try:
        return place.get("/api/v1/health/ready").status_code == 200
    except httpx.TransportError:
        return False


def test_every_way_in_stays_below_the_path(proxied: Proxied) -> None:
    for path, end in (
        ("", "/"),
        ("/", "/"),
        ("/docs", "/docs/"),
        ("/tag", "/tag/"),
        ("/help", "/help/"),
        ("/api/v1/docs", "/docs/"),
    ):
        answer = proxied.get(path)
        assert (answer.status_code, str(answer.url)) == (200, f"{proxied.address}/rtls{end}"), path
    document = proxied.get("/openapi.json")
    assert str(document.url) == f"{proxied.address}/rtls/api/v1/openapi.json"
    assert document.json()["info"]["title"] == "Dropanchor"
    assert proxied.get("/page/main.js").status_code == 200


@pytest.mark.browser
@pytest.mark.parametrize("proxied", [nginx], ids=["nginx"], indirect=True)  # the page knows no proxy, and takes seconds
def test_what_is_tried_in_the_documentation_goes_below_the_path(
    proxied: Proxied, shared_chromium: PausedBrowser
) -> None:
    with shared_chromium.driven() as browser, browser.new_context(ignore_https_errors=True) as context:
        context.set_default_timeout(1000 * PATIENCE_S)
        page, asked = context.new_page(), list[str]()
        page.on("request", lambda request: asked.append(request.url))
        page.goto(f"{proxied.address}/rtls/docs/#/health/get_live")  # opens it, though it lies far down
        operation = page.locator("#operations-health-get_live")
        operation.get_by_role("button", name="Try it out").click()
        operation.get_by_role("button", name="Execute").click()
        expect(operation.locator(".live-responses-table tbody .response-col_status")).to_contain_text("200")
        assert asked[-1] == f"{proxied.address}/rtls/api/v1/health/live"


def test_the_settings_of_the_guide_let_in_who_uses_the_name_of_the_proxy(proxied: Proxied) -> None:
    for name, status in (("yard.example.com", 200), ("other.example.com", 421)):
        answer = proxied.client.get(f"{proxied.service}/docs/", headers={"host": name})
        assert answer.status_code == status, name


def test_links_and_codes_that_leave_the_service_name_the_path(proxied: Proxied) -> None:
    share = proxied.client.post(f"{proxied.address}/rtls/api/v1/shares", json={"name": "Visitors"}).json()
    assert share["path"].startswith("/rtls/#share=")
    assert proxied.client.get(f"{proxied.address}{share['path']}").status_code == 200
    experiment = proxied.client.get(
        f"{proxied.address}/rtls/api/v1/ingest/phyphox", headers={"authorization": f"Bearer {proxied.tag_key}"}
    )
    assert f'"{proxied.address}/rtls/api/v1/ingest/phyphox?' in experiment.text


def test_websockets_and_streams_pass_and_ids_keep_what_is_escaped(proxied: Proxied) -> None:
    stream = f"{proxied.address}/rtls/api/v1/stream?max_hz=30"
    with proxied.client.stream("GET", stream) as events:
        lines = events.iter_lines()
        assert next(lines)  # at once, and not when a buffer is full
        url = f"wss{proxied.address.removeprefix('https')}/rtls/api/v1/ingest/stream"
        bearer = {"authorization": f"Bearer {proxied.tag_key}"}
        with connect(url, ssl=proxied.tls, proxy=None, additional_headers=bearer) as socket:
            assert json.loads(socket.recv(PATIENCE_S))["tag"] == "a/b"
            for _ in range(2):
                socket.send(json.dumps({"range": [{"t_ns": time.time_ns(), "anchor": 1, "range_m": 12.34}]}))
                assert "message" in json.loads(socket.recv(PATIENCE_S))
        wait_until(lambda: proxied.get("/api/v1/tags/a%2Fb/pose").status_code == 200)
        assert any("a/b" in line for line in lines if line.startswith("data: "))

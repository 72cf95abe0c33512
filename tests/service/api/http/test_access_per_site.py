"""A key of one site neither reads nor changes another one, whatever the route."""

import json
from pathlib import Path
from threading import Event
from typing import Any

import httpx
import numpy as np
import pytest
from fastapi import FastAPI
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from dropanchor_schemas.shares import ShareRequest
from dropanchor_schemas.wire import ENCODING_JSON
from dropanchor_service.api.export import omlox_document
from dropanchor_service.api.http.permissions import OPEN_PATHS
from dropanchor_service.api.routes import examples
from dropanchor_service.estimation.columns import HYPOTHESIS
from dropanchor_service.security import share_links
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.security.share_links import ShareLinks
from dropanchor_service.store import LatestPoses
from support.api import ask, kind_of, make_api_bench
from support.http_server import running_server
from support.patience import PATIENCE_S
from support.sites import app_of_sites, make_sites


class Company:
    """The sites a and b, each with a tag `cart`, and keys and share links for one of them or for both."""

    def __init__(self, folder: Path) -> None:
        keys = self.keys = ApiKeys(folder)
        self.admin_of_a = keys.add("admin of a", Scope.ADMIN, site="a")
        self.reader_of_all = keys.add("reader", Scope.READ)
        self.cart_of_a = keys.add_for_tag("cart of a", "cart", site="a")
        self.cart_of_no_site = keys.add_for_tag("cart", "cart")
        self.received: list[tuple[str, str, bytes, str]] = []
        self.links = ShareLinks(folder)
        self.link_to_a = self.links.add("a", ShareRequest())[1]
        self.authenticator = Authenticator({share_links.SOURCE: self.links, SOURCE: keys})
        self.latest = LatestPoses()
        sites = make_sites("a", "b")
        self.app: FastAPI = app_of_sites(sites, self.authenticator, self.received, latest=self.latest)

    def move(self, dx: float) -> None:
        """Move the tags of both sites."""
        poses = self.latest.since()[1]
        poses["x"] += dx
        self.latest.write(poses, np.empty(0, HYPOTHESIS))

    def ask(self, method: str, path: str, secret: str, **options: Any) -> httpx.Response:
        return ask(self.app, method, f"/api/v1{path}", headers={"authorization": f"Bearer {secret}"}, **options)


@pytest.fixture(scope="module")
def company(tmp_path_factory: pytest.TempPathFactory) -> Company:
    return Company(tmp_path_factory.mktemp("company"))


def operations(app: FastAPI) -> list[tuple[str, str]]:
    """Return every operation of a site, with the tag `cart` and the anchor 7; `{site}` stays."""
    found = [
        (method.upper(), path.removeprefix("/api/v1").replace("{tag}", "cart").replace("{anchor}", "7"))
        for path, methods in app.openapi()["paths"].items()
        for method in methods
    ]
    return [(method, f"/api/v1{path}") for method, path in found if path.startswith("/sites/{site}")]


def omlox_operations(version: str) -> list[tuple[str, str]]:
    """Return every operation of the omlox interface of a site, which its own document describes."""
    paths = omlox_document()["paths"]
    base = f"/sites/{{site}}/omlox/{version}"
    return [(method.upper(), base + path) for path, methods in paths.items() for method in methods]


def test_no_operation_of_another_site_takes_the_key_of_a_site_or_of_its_tag(company: Company) -> None:
    crossed = [*operations(company.app), *omlox_operations("v2"), *omlox_operations("v1")]
    families = {path.split("/")[5] for _, path in crossed}
    assert families >= {"poses", "stream", "tags", "tracks", "anchors", "site", "ingest", "recordings", "plans"}
    assert families >= {"zones", "event-rules", "events", "destinations", "figures", "shares", "trackables", "fences"}
    for method, path in crossed:
        assert kind_of(ask(company.app, method, path.replace("{site}", "b"))) == "unauthenticated"
        for secret in (company.admin_of_a, company.cart_of_a, company.cart_of_no_site, company.link_to_a):
            headers = {"authorization": f"Bearer {secret}"}
            response = ask(company.app, method, path.replace("{site}", "b"), headers=headers)
            assert kind_of(response) == "forbidden", (method, path)
    assert company.received == []


def test_a_path_that_is_spelt_in_another_way_needs_the_same_key(company: Company) -> None:
    for path in ("/sites/b/omlox/v2/providers/x%0A", "/sites/b/%6Fmlox/v2/providers/x%0A", "/sites%2Fb/omlox/v2/zones"):
        assert kind_of(ask(company.app, "GET", path)) == "unauthenticated", path
        headers = {"authorization": f"Bearer {company.admin_of_a}"}
        assert kind_of(ask(company.app, "GET", path, headers=headers)) == "forbidden", path
    for site in ("a", "b"):  # the document holds nothing of a site
        assert ask(company.app, "GET", f"/sites/{site}/omlox/v2/openapi.json").status_code == 200


def test_a_share_link_shows_its_site_alone_and_a_limited_one_its_tags(company: Company) -> None:
    made = company.ask("POST", "/sites/a/shares", company.admin_of_a, json={"tag": "cart", "view": "tag=cart"}).json()
    assert (made["site"], made["path"]) == ("a", f"/?site=a#tag=cart&share={made['secret']}")
    for secret, tags in ((made["secret"], 403), (company.link_to_a, 200)):
        assert company.ask("GET", "/sites/a/poses", secret).json()["poses"][0]["x"] == 1.0
        assert company.ask("GET", "/sites/a/tags/other/pose", secret).status_code == (403 if tags == 403 else 404)
        assert company.ask("GET", "/sites/a/zones", secret).status_code == tags
        assert company.ask("GET", "/sites/b/poses", secret).status_code == 403
        assert ask(company.app, "GET", "/metrics", headers={"authorization": f"Bearer {secret}"}).status_code == 403
    assert [site["site"] for site in company.ask("GET", "/sites", company.link_to_a).json()["sites"]] == ["a"]
    admin_of_b = company.keys.add("admin of b", Scope.ADMIN, site="b")
    assert company.ask("GET", "/sites/b/shares", admin_of_b).json()["shares"] == []
    assert company.ask("DELETE", f"/sites/b/shares/{made['id']}", admin_of_b).status_code == 404
    assert company.ask("DELETE", f"/sites/a/shares/{made['id']}", company.admin_of_a).status_code == 204
    assert company.ask("GET", "/sites/a/poses", made["secret"]).status_code == 401


def test_the_omlox_interface_of_a_site_holds_its_tags_alone(company: Company) -> None:
    for site, x in (("a", 1.0), ("b", 2.0)):
        headers = {"authorization": f"Bearer {company.reader_of_all}"}
        base = f"/sites/{site}/omlox/v2"
        (location,) = ask(company.app, "GET", f"{base}/providers/locations?crs=local", headers=headers).json()
        assert location["position"]["coordinates"] == [x, 0.0, 0.0]
    with running_server(company.app, Event()) as port:
        url = f"ws://127.0.0.1:{port}/sites/{{}}/omlox/v2/ws/socket"
        for site, secret, event in (("a", company.admin_of_a, "subscribed"), ("b", company.admin_of_a, "error")):
            with connect(url.format(site), proxy=None) as socket:
                request = {"event": "subscribe", "topic": "location_updates", "params": {"token": secret}}
                socket.send(json.dumps(request))
                assert json.loads(socket.recv(PATIENCE_S))["event"] == event
        with connect(url.format("b"), proxy=None) as socket:
            params = {"token": company.reader_of_all, "crs": "local"}
            socket.send(json.dumps({"event": "subscribe", "topic": "location_updates", "params": params}))
            assert json.loads(socket.recv(PATIENCE_S))["event"] == "subscribed"
            company.move(7.0)
            (location,) = json.loads(socket.recv(PATIENCE_S))["payload"]
            assert location["position"]["coordinates"] == [9.0, 0.0, 0.0]
            company.move(-7.0)
        with connect(url.format("c"), proxy=None) as socket, pytest.raises(ConnectionClosed) as closed:
            socket.recv(PATIENCE_S)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4404


def test_the_key_of_a_site_reads_and_changes_its_own_site(company: Company) -> None:
    assert company.ask("GET", "/sites/a/poses", company.admin_of_a).json()["poses"][0]["x"] == 1.0
    assert company.ask("GET", "/sites/a/access", company.admin_of_a).json() == {"scope": "admin"}
    assert company.ask("PUT", "/sites/a/tags/cart/settings", company.admin_of_a, json={}).status_code == 200
    refused = company.ask("GET", "/sites/b/poses", company.admin_of_a)
    assert refused.json()["detail"] == (
        "The key of 'admin of a' has no scope in site 'b'; this request needs the scope read in site 'b'."
    )
    for spelling in ("%62", "b%2F..", "c", "a%2F..%2Fb"):
        assert company.ask("GET", f"/sites/{spelling}/poses", company.admin_of_a).status_code == 403


def test_the_list_of_sites_has_those_that_the_key_may_read(company: Company) -> None:
    def sites(secret: str) -> list[str]:
        return [site["site"] for site in company.ask("GET", "/sites", secret).json()["sites"]]

    assert sites(company.admin_of_a) == ["a"]
    assert sites(company.reader_of_all) == ["a", "b"]
    assert company.ask("GET", "/sites", company.cart_of_a).status_code == 403
    for secret, status in ((company.admin_of_a, 403), (company.reader_of_all, 200)):
        metrics = ask(company.app, "GET", "/metrics", headers={"authorization": f"Bearer {secret}"})
        assert metrics.status_code == status


def test_a_key_for_all_sites_reads_each_and_changes_none(company: Company) -> None:
    for site, x in (("a", 1.0), ("b", 2.0)):
        assert company.ask("GET", f"/sites/{site}/poses", company.reader_of_all).json()["poses"][0]["x"] == x
        assert company.ask("PUT", f"/sites/{site}/anchors/7", company.reader_of_all, json={}).status_code == 403


def test_samples_reach_the_site_of_the_key_and_no_other(company: Company) -> None:
    company.received.clear()
    for path in ("/ingest/samples", "/sites/a/ingest/samples"):
        assert company.ask("POST", path, company.cart_of_a, json=examples.SAMPLES).status_code == 202
    assert [message[:2] for message in company.received] == [("a", "cart")] * 2
    assert company.received[0][3] == ENCODING_JSON
    unnamed = company.ask("POST", "/ingest/samples", company.cart_of_no_site, json=examples.SAMPLES)
    assert kind_of(unnamed) == "forbidden"
    assert "dropanchor key add NAME --tag TAG --site SITE" in unnamed.json()["detail"]


def test_a_web_socket_takes_samples_of_the_site_of_its_key_only(company: Company) -> None:
    company.received.clear()

    def connected(port: int, path: str, secret: str) -> Any:
        headers = {"authorization": f"Bearer {secret}"}
        return connect(f"ws://127.0.0.1:{port}/api/v1{path}", additional_headers=headers, proxy=None)

    with running_server(company.app, Event()) as port:
        for path in ("/ingest/stream", "/sites/a/ingest/stream"):
            with connected(port, path, company.cart_of_a) as socket:
                socket.recv(PATIENCE_S)
                socket.send("{}")
                socket.recv(PATIENCE_S)
        for path, secret in (
            ("/sites/b/ingest/stream", company.cart_of_a),
            ("/sites/a/ingest/stream", company.cart_of_no_site),
            ("/ingest/stream", company.admin_of_a),
        ):
            with connected(port, path, secret) as socket, pytest.raises(ConnectionClosed) as closed:
                socket.recv(PATIENCE_S)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 4403
    assert [message[:2] for message in company.received] == [("a", "cart")] * 2


def test_an_only_site_takes_keys_of_itself_and_refuses_those_of_another_site(tmp_path: Path) -> None:
    keys, bench = ApiKeys(tmp_path), make_api_bench()
    app = bench.app(authenticator=Authenticator({SOURCE: keys}))
    own, other = (keys.add(site, Scope.ADMIN, site=site) for site in ("default", "other"))
    tag = keys.add_for_tag("elsewhere", "cart", site="other")
    for path in ("/api/v1/poses", "/api/v1/sites/default/poses", "/metrics"):
        assert path not in OPEN_PATHS
        for secret, status in ((own, 200), (other, 403), (tag, 403)):
            assert ask(app, "GET", path, headers={"authorization": f"Bearer {secret}"}).status_code == status
    sent = ask(app, "POST", "/api/v1/ingest/samples", headers={"authorization": f"Bearer {tag}"}, json=examples.SAMPLES)
    assert kind_of(sent) == "forbidden"
    assert bench.received == []

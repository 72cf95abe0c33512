"""Each site has its routes below /sites; the routes without a site are those of the only one."""

import json
from threading import Event

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from dropanchor_schemas.answers import SiteList
from dropanchor_schemas.site import Anchor
from dropanchor_service.api.http.permissions import Need, need_of
from support.api import ask, kind_of, make_api_bench
from support.delivery import SECRET
from support.http_server import running_server
from support.patience import PATIENCE_S
from support.sites import T_NS, app_of_sites, make_sites


def test_poses_tags_and_anchors_are_those_of_the_site_in_the_path() -> None:
    sites = make_sites("north", "Lager Süd")
    app = app_of_sites(sites)
    sites[1].store.set_anchor(Anchor(id="9"))
    for path, x, anchors in (("north", 1.0, ["7"]), ("Lager%20S%C3%BCd", 2.0, ["7", "9"])):
        base = f"/api/v1/sites/{path}"
        assert [pose["x"] for pose in ask(app, "GET", f"{base}/poses").json()["poses"]] == [x]
        assert ask(app, "GET", f"{base}/tags/cart/pose").json()["x"] == x
        assert ask(app, "GET", f"{base}/tags/cart/explain").json()["pose"]["x"] == x
        assert [tag["tag"] for tag in ask(app, "GET", f"{base}/tags").json()["tags"]] == ["cart"]
        assert [anchor["id"] for anchor in ask(app, "GET", f"{base}/anchors").json()["anchors"]] == anchors
    assert ask(app, "GET", "/api/v1/sites/north/site").json()["id"] == "north"


def test_a_change_in_one_site_leaves_the_other_as_it_was() -> None:
    sites = make_sites("a", "full")
    app = app_of_sites(sites)
    assert ask(app, "PUT", "/api/v1/sites/a/anchors/7", json={"id": "7", "x": 4.0}).status_code == 200
    assert ask(app, "PUT", "/api/v1/sites/a/tags/lift/settings", json={"height_m": 2.0}).status_code == 200
    assert kind_of(ask(app, "PUT", "/api/v1/sites/full/tags/lift/settings", json={})) == "tags-full"
    assert ask(app, "DELETE", "/api/v1/sites/a/tags/cart").status_code == 204
    assert [[anchor.x for anchor in site.store.site.anchors] for site in sites] == [[4.0], [0.0]]
    assert [[tag.name for tag in site.tags.listed()] for site in sites] == [["lift"], ["cart"]]
    assert ask(app, "GET", "/api/v1/sites/a/poses").json()["poses"] == []
    assert len(ask(app, "GET", "/api/v1/sites/full/poses").json()["poses"]) == 1


def test_all_sites_are_listed_with_how_many_tags_they_have() -> None:
    sites = make_sites("a", "b")
    app = app_of_sites(sites)
    sites[1].tags.presence.set_token("cart", True)
    sites[1].tags.register("lift")
    listed = SiteList.model_validate(ask(app, "GET", "/api/v1/sites").json()).sites
    assert [(site.site, site.anchors, site.tags, site.online) for site in listed] == [("a", 1, 1, 0), ("b", 1, 2, 1)]


def test_with_several_sites_a_path_without_one_is_refused_with_a_sentence() -> None:
    app = app_of_sites(make_sites("a", "b"))
    for method, path in (
        ("GET", "/api/v1/poses"),
        ("GET", "/api/v1/stream"),
        ("GET", "/api/v1/recordings"),
        ("PUT", "/api/v1/zones/1"),
        ("GET", "/api/v1/shares"),
        ("GET", "/omlox/v2/zones"),
    ):
        refused = ask(app, method, path)
        assert kind_of(refused) == "several-sites"
        assert refused.json()["detail"].startswith(f"{path} names none of the 2 sites of this service.")
    assert kind_of(ask(app, "GET", "/api/v1/sites/c/poses")) == "unknown-site"
    assert kind_of(ask(app, "POST", "/api/v1/ingest/samples?tag=cart", json={})) == "several-sites"
    assert ask(app, "GET", "/api/v1/health/live").status_code == 200


def test_the_page_needs_a_site_in_its_address_and_leads_to_the_overview_without_one() -> None:
    app = app_of_sites(make_sites("a", "b"))
    without = ask(app, "GET", "/")
    assert (without.status_code, without.headers["location"]) == (307, "sites/")
    assert 'src="page.js"' in ask(app, "GET", "/sites/").text
    assert 'src="page/main.js"' in ask(app, "GET", "/?site=a").text


def test_the_list_of_sites_counts_states_and_tags_that_need_a_person() -> None:
    sites = make_sites("a", "b")
    app = app_of_sites(sites)
    sites[0].tags.register("lift")
    row = sites[1].tags.register("low").row
    sites[1].health.record(row, {"battery_fraction": 0.1}, T_NS)
    listed = SiteList.model_validate(ask(app, "GET", "/api/v1/sites").json()).sites
    assert [(site.tags, site.states, site.needs_care) for site in listed] == [
        (2, {"tracking": 1}, 0),
        (2, {"tracking": 1}, 1),
    ]


def test_zones_rules_events_and_destinations_are_those_of_the_site_in_the_path() -> None:
    app = app_of_sites(make_sites("a", "b"))
    zone = {"id": "dock", "shape": {"type": "circle", "x": 0.0, "y": 0.0, "radius_m": 5.0}}
    rule = {"id": "low", "type": "battery_low"}
    hook = {"id": "mes", "type": "webhook", "url": "http://93.184.216.34/x", "secret": SECRET}
    for path, body in (("zones/dock", zone), ("event-rules/low", rule), ("destinations/mes", hook)):
        assert ask(app, "PUT", f"/api/v1/sites/a/{path}", json=body).status_code == 200, path
        assert ask(app, "GET", f"/api/v1/sites/a/{path}").status_code == 200
        assert ask(app, "GET", f"/api/v1/sites/b/{path}").status_code == 404
        assert ask(app, "DELETE", f"/api/v1/sites/b/{path}").status_code == 404
    assert ask(app, "GET", "/api/v1/sites/b/events").json() == {"events": [], "next": None}
    assert ask(app, "GET", "/api/v1/sites/a/zone-occupancy").json() == {"zones": []}
    assert kind_of(ask(app, "GET", "/api/v1/sites/a/figures")) == "no-history"
    assert kind_of(ask(app, "POST", "/api/v1/sites/a/shares", json={})) == "no-access-control"


def test_a_phone_without_a_key_names_its_site_in_the_path() -> None:
    received: list[tuple[str, str, bytes, str]] = []
    app, stopping = app_of_sites(make_sites("a", "b"), received=received), Event()
    experiment = ask(app, "GET", "/api/v1/sites/b/ingest/phyphox?tag=anna").text
    assert 'address="http://test/api/v1/sites/b/ingest/phyphox?tag=anna"' in experiment
    with running_server(app, stopping) as port:
        with connect(f"ws://127.0.0.1:{port}/api/v1/sites/b/ingest/stream?tag=anna", proxy=None) as socket:
            socket.recv(PATIENCE_S)
            socket.send("{}")
            socket.recv(PATIENCE_S)
        unnamed = f"ws://127.0.0.1:{port}/api/v1/ingest/stream?tag=anna"
        with connect(unnamed, proxy=None) as socket, pytest.raises(ConnectionClosed) as closed:
            socket.recv(PATIENCE_S)
    assert [message[:2] for message in received] == [("b", "anna")]
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.reason == "Say which site this is: add ?site=SITE to the address of the page."


def test_an_only_site_has_both_paths() -> None:
    bench = make_api_bench()
    bench.answers.tags.register("a")
    app = bench.app()
    for path in ("tags", "anchors", "site", "pending-tags", "zones", "events", "shares"):
        with_site = ask(app, "GET", f"/api/v1/sites/default/{path}").json()
        assert with_site == ask(app, "GET", f"/api/v1/{path}").json()
    assert kind_of(ask(app, "GET", "/api/v1/sites/other/tags")) == "unknown-site"


def test_the_same_changes_need_the_same_scope_with_and_without_a_site_in_the_path() -> None:
    for prefix in ("/api/v1", "/api/v1/sites/a"):
        assert need_of("PUT", f"{prefix}/site") is Need.ADMIN
        assert need_of("PUT", f"{prefix}/anchors/1") is Need.WRITE
        assert need_of("DELETE", f"{prefix}/tags/a") is Need.ADMIN
        assert need_of("GET", f"{prefix}/poses") is Need.LINK_TO_TAGS


def test_the_stream_of_a_site_holds_its_tags_alone_whatever_it_asks_for() -> None:
    sites, stopping = make_sites("a", "b"), Event()
    app = app_of_sites(sites, stopping=stopping)
    with running_server(app, stopping) as port:
        for site, x in (("a", 1.0), ("b", 2.0)):
            for query in ("", "?tags=cart", "?group=", "?box=0,-1,9,1"):
                url = f"http://127.0.0.1:{port}/api/v1/sites/{site}/stream{query}"
                with httpx.stream("GET", url, trust_env=False, verify=False) as stream:
                    lines = stream.iter_lines()
                    assert next(lines) == "event: snapshot"
                    frame = json.loads(next(lines).removeprefix("data: "))
                assert (frame["tags"], frame["x"]) == (["cart"], [x]), (site, query)

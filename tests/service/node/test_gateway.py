"""An API node before three owners with two sites each: what passes through it is what the owners say."""

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Event
from typing import NamedTuple

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from dropanchor_schemas.answers import SiteList
from dropanchor_schemas.pose import SitePosesList
from dropanchor_service.node.owners import Owner
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from support.api import kind_of
from support.api_nodes import BareNode, running_owner
from support.http_server import running_server
from support.patience import PATIENCE_S
from support.sites import T_NS, app_of_sites, make_sites
from support.zenoh_router import free_port, wait_until

BUCKETS = ("017", "018", "019")
SAMPLE = {"t_ns": T_NS, "anchor": 7, "range_m": 3.0}
BOARD = "https://board.example"


class Cluster(NamedTuple):
    """secrets: of keys: one that reads all, one that reads 018.a alone, one of the tag `cart` in 019.b."""

    node: BareNode
    client: httpx.Client
    owners: list[Owner]
    secrets: dict[str, str]
    received: dict[str, list[tuple[str, str, bytes, str]]]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    keys = ApiKeys(tmp_path_factory.mktemp("keys"))
    secrets = {
        "all": keys.add("all", Scope.ADMIN),
        "one": keys.add("one", Scope.READ, site="018.a"),
        "cart": keys.add_for_tag("cart", "cart", site="019.b"),
    }
    guard, stopping = Authenticator({SOURCE: keys}), Event()
    received: dict[str, list[tuple[str, str, bytes, str]]] = {bucket: [] for bucket in BUCKETS}
    with ExitStack() as opened:
        opened.callback(stopping.set)
        owners = []
        for bucket in BUCKETS:
            app = app_of_sites(make_sites(f"{bucket}.a", f"{bucket}.b"), guard, received[bucket], stopping)
            owners.append(opened.enter_context(running_owner(app, bucket)))
        node = BareNode(guard, (BOARD,))
        url = opened.enter_context(node.running(*owners))
        headers = {"authorization": f"Bearer {secrets['all']}"}
        client = opened.enter_context(httpx.Client(base_url=url, headers=headers, trust_env=False, verify=False))
        yield Cluster(node, client, owners, secrets, received)


def test_prometheus_finds_the_metrics_of_every_owner_through_a_node(cluster: Cluster) -> None:
    targets = cluster.client.get("/metrics/targets")
    assert targets.headers["content-type"] == "application/json"
    found = [f"{one['labels']['__scheme__']}://{target}" for one in targets.json() for target in one["targets"]]
    assert sorted(found) == sorted(owner.address for owner in cluster.owners)
    for url in found:
        assert httpx.get(f"{url}/metrics", headers=bearer(cluster.secrets["all"]), trust_env=False).status_code == 200
    for path in ("/metrics", "/metrics/targets"):
        assert cluster.client.get(path, headers=bearer(cluster.secrets["cart"])).status_code == 403


def bearer(secret: str) -> dict[str, str]:
    return {"authorization": f"Bearer {secret}"}


def test_an_answer_about_one_site_is_that_of_its_owner(cluster: Cluster) -> None:
    for method, path, body in (
        ("GET", "/api/v1/sites/018.a/poses?state=tracking", None),
        ("GET", "/api/v1/sites/018.a/tags/cart/pose", None),
        ("HEAD", "/api/v1/sites/018.a/tags/cart/pose", None),
        ("GET", "/api/v1/sites/018.a/nothing", None),
        ("GET", "/api/v1/sites/018.c/poses", None),
        ("PUT", "/api/v1/sites/018.a/anchors/8%2F9", {"id": "8/9", "x": 2.0}),
        ("PUT", "/api/v1/sites/018.a/anchors/8", {"id": "9"}),
        ("PUT", "/api/v1/sites/018.a/anchors/8", {"id": 9}),
        ("POST", "/api/v1/sites/018.a/tags/cart", None),
        ("POST", "/api/v1/sites", {}),
        ("GET", "/sites/018.a/omlox/v2/trackables", None),
    ):
        direct = httpx.request(
            method, f"{cluster.owners[1].address}{path}", headers=bearer(cluster.secrets["all"]), json=body
        )
        through = cluster.client.request(method, path, json=body)
        assert (through.status_code, through.content) == (direct.status_code, direct.content), path
        internal = {"date", "vary", "x-request-id", "dropanchor-bucket", "dropanchor-epoch"}
        shown = [
            {name: value for name, value in each.headers.items() if name not in internal} for each in (through, direct)
        ]
        assert shown[0] == shown[1], path
        assert not any(name.startswith("dropanchor-") for name in through.headers)


def test_what_concerns_all_sites_is_joined(cluster: Cluster) -> None:
    sites = [f"{bucket}.{name}" for bucket in BUCKETS for name in "ab"]
    listed = SiteList.model_validate_json(cluster.client.get("/api/v1/sites").content)
    assert [site.site for site in listed.sites] == sites
    poses = SitePosesList.model_validate_json(cluster.client.get("/api/v1/sites/poses").content)
    assert [(site.site, [pose.x for pose in site.poses]) for site in poses.sites] == [
        (site, [1.0 + index % 2]) for index, site in enumerate(sites)
    ]
    only = cluster.client.get("/api/v1/sites/poses?text=nobody").json()["sites"]
    assert [site["poses"] for site in only] == [[]] * 6
    own = cluster.client.get("/api/v1/sites", headers=bearer(cluster.secrets["one"])).json()
    assert [site["site"] for site in own["sites"]] == ["018.a"]
    assert kind_of(cluster.client.get("/api/v1/sites", headers=bearer("no"))) == "unauthenticated"
    assert kind_of(cluster.client.get("/api/v1/sites/poses?speed=3")) == "invalid-request"


def test_sites_without_an_owner_are_named_and_the_others_are_there(cluster: Cluster) -> None:
    nobody = Owner("018", 1, "", "")
    dead = Owner("019", 1, "dead", f"http://127.0.0.1:{free_port()}")
    try:
        cluster.node.take(cluster.owners[0], nobody, dead)
        listed = SiteList.model_validate_json(cluster.client.get("/api/v1/sites").content)
        assert ([site.site for site in listed.sites], listed.unavailable) == (["017.a", "017.b"], ["018", "019"])
        for site, sentence in (("018.a", "have no owner now"), ("019.a", "cannot be reached")):
            refused = cluster.client.get(f"/api/v1/sites/{site}/poses")
            assert kind_of(refused) == "not-ready"
            assert sentence in refused.json()["detail"]
            assert refused.headers["retry-after"] == "1"
        cluster.node.take(nobody, dead)
        assert kind_of(cluster.client.get("/api/v1/sites")) == "not-ready"
        cluster.node.take()
        assert "has not found the owners" in cluster.client.get("/api/v1/sites/017.a/poses").json()["detail"]
    finally:
        cluster.node.take(*cluster.owners)


def test_the_key_of_a_tag_leads_to_its_site_and_no_other_one(cluster: Cluster) -> None:
    cart = bearer(cluster.secrets["cart"])
    taken = cluster.client.post("/api/v1/ingest/samples", headers=cart, json={"range": [SAMPLE]})
    assert taken.status_code == 202, taken.text
    assert [message[:2] for message in cluster.received["019"]] == [("019.b", "cart")]
    with connect(socket_url(cluster, "/api/v1/ingest/stream"), proxy=None, additional_headers=cart) as socket:
        greeting = json.loads(socket.recv(PATIENCE_S))
        socket.send("{}")
        assert (greeting["tag"], json.loads(socket.recv(PATIENCE_S))["message"]) == ("cart", 1)
    protocols = [Subprotocol("dropanchor.samples"), Subprotocol(f"dropanchor.key.{cluster.secrets['cart']}")]
    with connect(socket_url(cluster, "/api/v1/ingest/stream"), proxy=None, subprotocols=protocols) as socket:
        assert socket.subprotocol == "dropanchor.samples"
        assert json.loads(socket.recv(PATIENCE_S))["tag"] == "cart"
    assert [message[:2] for message in cluster.received["019"]] == [("019.b", "cart")] * 2
    assert cluster.received["017"] == cluster.received["018"] == []
    for refused, kind in ((cluster.secrets["all"], "several-sites"), ("dra_nobody", "unauthenticated")):
        answer = cluster.client.post("/api/v1/ingest/samples", headers=bearer(refused), json={})
        assert kind_of(answer) == kind


def socket_url(cluster: Cluster, path: str) -> str:
    return f"ws{str(cluster.client.base_url).removeprefix('http').rstrip('/')}{path}"


def test_a_web_socket_ends_as_its_owner_ends_it(cluster: Cluster) -> None:
    for path, code, reason in (
        ("/api/v1/sites/017.a/ingest/stream", 4401, "This service needs a key."),
        ("/api/v1/sites/020.a/ingest/stream", 1012, "There is no site '020.a'."),
    ):
        with connect(socket_url(cluster, path), proxy=None) as socket, pytest.raises(ConnectionClosed) as closed:
            socket.recv(PATIENCE_S)
        assert closed.value.rcvd is not None
        assert (closed.value.rcvd.code, closed.value.rcvd.reason.startswith(reason)) == (code, True)


def test_a_node_has_its_own_page_health_and_metrics(cluster: Cluster) -> None:
    client = cluster.client
    assert client.get("/").headers["location"] == "sites/"
    assert 'src="page.js"' in client.get("/sites/").text
    assert 'src="page/main.js"' in client.get("/?site=017.a").text
    assert client.get("/api/v1/health/ready").json() == {"status": "ready", "impaired": [], "impaired_phrases": []}
    assert client.get("/api/v1/health/live", headers={"authorization": ""}).status_code == 200
    assert "dropanchor_node_buckets 3.0" in client.get("/metrics").text
    assert client.get("/api/v1/sites/017.a/poses").status_code == 200
    assert 'dropanchor_node_requests_total{status="200"}' in client.get("/metrics").text
    assert kind_of(client.get("/metrics", headers={"authorization": ""})) == "unauthenticated"
    assert kind_of(client.get("/metrics", headers=bearer(cluster.secrets["one"]))) == "forbidden"
    assert kind_of(client.get("/api/v1/poses")) == "several-sites"


def test_other_pages_and_ids_of_requests_are_the_matter_of_the_node(cluster: Cluster) -> None:
    from_board = cluster.client.get("/api/v1/sites/017.a/poses", headers={"origin": BOARD, "x-request-id": "r-1"})
    assert from_board.headers.get_list("access-control-allow-origin") == [BOARD]
    assert from_board.headers["x-request-id"] == "r-1"
    refused = cluster.client.get("/api/v1/sites/020.a/poses", headers={"origin": BOARD, "x-request-id": "no id"})
    assert refused.headers["access-control-allow-origin"] == BOARD
    assert len(refused.headers["x-request-id"]) == 32
    other = cluster.client.get("/api/v1/sites/017.a/poses", headers={"origin": "https://other.example"})
    assert "access-control-allow-origin" not in other.headers


def test_a_client_of_a_service_without_keys_is_who_it_is_behind_a_node_too(tmp_path: Path) -> None:  # noqa: ARG001
    app, node = app_of_sites(make_sites("a"), stopping=Event()), BareNode()
    with (
        running_owner(app, "yard") as owner,
        node.running(owner) as url,
        httpx.Client(trust_env=False, verify=False) as client,
    ):
        own_page, foreign = Origin(url), Origin("https://other.example")
        address = f"ws{url.removeprefix('http')}/api/v1/ingest/stream?tag=anna"
        with connect(address, proxy=None, origin=own_page) as socket:
            assert json.loads(socket.recv(PATIENCE_S))["tag"] == "anna"
        with connect(address, proxy=None, origin=foreign) as socket, pytest.raises(ConnectionClosed) as closed:
            socket.recv(PATIENCE_S)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4403
        assert (
            f'address="{url}/api/v1/ingest/phyphox?tag=anna"'
            in client.get(f"{url}/api/v1/ingest/phyphox?tag=anna").text
        )
        assert 'src="page/main.js"' in client.get(f"{url}/").text
        node.take(Owner("yard", 1, "", ""))
        assert 'src="page/main.js"' in client.get(f"{url}/").text
        node.take(owner)
        forged = {"dropanchor-node": "not the secret of the tests", "x-forwarded-for": "10.0.0.1"}
        refused = client.get(f"{owner.address}/api/v1/poses", headers=forged)
        assert (kind_of(refused), "is not that of this service" in refused.text) == ("forbidden", True)


def test_a_service_without_the_secret_of_the_nodes_says_what_to_set() -> None:
    app, node = app_of_sites(make_sites("a"), stopping=Event()), BareNode()
    with running_owner(app, "yard", secret=None) as owner, node.running(owner) as url:
        refused = httpx.get(f"{url}/api/v1/poses", trust_env=False, verify=False)
        assert (kind_of(refused), "set cluster.node_secret" in refused.text) == ("forbidden", True)


def test_streams_pass_at_once_and_end_with_their_client_or_when_the_site_has_a_new_owner() -> None:
    app, stopping = app_of_sites(make_sites("a"), stopping=(ends := Event())), Event()
    node = BareNode()
    with (
        running_owner(app, "yard") as owner,
        node.running(owner) as url,
        httpx.Client(trust_env=False, verify=False) as client,
    ):
        for how in ("client", "successor"):
            with client.stream("GET", f"{url}/api/v1/stream") as stream:
                lines = stream.iter_lines()
                assert next(lines) == "event: snapshot"
                assert node.metrics.open._value.get() == 1.0
                if how == "successor":
                    node.take(Owner("yard", 2, "b", owner.address))
                    assert list(lines)[-1] == ""
            wait_until(lambda: node.metrics.open._value.get() == 0.0)
        ends.set()
    assert not stopping.is_set()


def test_a_body_that_is_too_large_is_refused_and_a_long_one_passes() -> None:
    app, node = app_of_sites(make_sites("a"), stopping=Event()), BareNode()
    with (
        running_owner(app, "yard") as owner,
        node.running(owner) as url,
        httpx.Client(trust_env=False, verify=False) as client,
    ):
        too_large = client.put(f"{url}/api/v1/anchors/1", content=b" " * 1_048_577)
        assert kind_of(too_large) == "body-too-large"
        plan = client.post(f"{url}/api/v1/plan-images", content=b"x" * 3_000_000)
        assert kind_of(plan) == "plan-image-refused", plan.text


def test_two_nodes_answer_alike(cluster: Cluster) -> None:
    other = BareNode()
    with running_server(other.app, Event()) as port:
        other.take(*cluster.owners)
        for path in ("/api/v1/sites", "/api/v1/sites/017.b/tags", "/api/v1/sites/poses"):
            answer = httpx.get(
                f"http://127.0.0.1:{port}{path}", headers=bearer(cluster.secrets["all"]), trust_env=False, verify=False
            )
            assert answer.content == cluster.client.get(path).content

"""Three services with a bucket each, a standby, and two API nodes before them: all of them real processes."""

import json
import math
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect

from dropanchor_service.cluster import leases
from dropanchor_service.cluster.database import connect
from dropanchor_service.node.owners import HOLD_S
from dropanchor_tag_client import TagClient
from support.browser import PausedBrowser, open_page
from support.patience import PATIENCE_S
from support.postgresql import Postgresql, needs_postgresql, running_postgresql
from support.repeated import repeated
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, free_port, running_router, wait_until

pytestmark = needs_postgresql

BUCKETS = ("017", "018", "019")
SITES = [f"{bucket}.{name}" for bucket in BUCKETS for name in ("north", "south")]
SETTINGS = "\n".join(
    f"""
[sites."{site}".site]
anchors = [{{ id = "7" }}]
[sites."{site}".tags.cart]
start = {{ x = 7.5, y = 1.0, heading_rad = 1.570796 }}
"""
    for site in SITES
)
LEASE_S = 1.0
CENTRE_M, RADIUS_M, SPEED_MPS = (5.0, 1.0), 2.5, 1.0


class Cluster:
    """owners: by bucket. nodes: two."""

    def __init__(self, folder: Path, opened: ExitStack) -> None:
        self.router = free_endpoint()
        opened.enter_context(running_router(self.router))
        self.database: Postgresql = opened.enter_context(running_postgresql())
        self.url = self.database.new_database()
        self._folder = folder
        self._opened = opened
        self._secret = folder / "node.secret"
        self._secret.write_text("a secret of this test\n")
        self.owners = {bucket: self.start(bucket, f"{bucket}-a") for bucket in BUCKETS}
        options = ("--url", self.url, "--node-secret", str(self._secret))
        self.nodes = [opened.enter_context(running_service(*options, subcommand="api")) for _ in range(2)]

    def start(self, bucket: str, name: str) -> Running:
        """Start a service that can own a bucket."""
        port = free_port()
        config = self._folder / f"{name}.toml"
        cluster = {"url": self.url, "bucket": bucket, "name": name, "address": f"http://127.0.0.1:{port}"}
        lines = [f"{key} = {json.dumps(value)}" for key, value in cluster.items()]
        lines += [f"node_secret = {json.dumps(str(self._secret))}", f"lease_s = {LEASE_S}"]
        config.write_text("\n".join(["[cluster]", *lines, SETTINGS]))
        options = ("--config", str(config), "--zenoh-connect", self.router, "--port", str(port))
        return self._opened.enter_context(running_service(*options, ready=False))


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with ExitStack() as opened:
        yield Cluster(tmp_path_factory.mktemp("cluster"), opened)


@contextmanager
def driving_carts(cluster: Cluster, *sites: str) -> Iterator[None]:
    """Let the cart of each site drive round a circle until the block ends."""
    with ExitStack() as opened:
        clients = [
            opened.enter_context(TagClient("cart", site=site, connect=cluster.router, connect_timeout_s=PATIENCE_S))
            for site in sites
        ]
        begun_s = time.monotonic()

        def publish(_: int) -> None:
            turned = (time.monotonic() - begun_s) * SPEED_MPS / RADIUS_M
            x, y = CENTRE_M[0] + RADIUS_M * math.cos(turned), CENTRE_M[1] + RADIUS_M * math.sin(turned)
            for client in clients:
                client.publish_heading(math.remainder(turned + math.pi / 2, math.tau), std_rad=0.03)
                client.publish_range("7", math.hypot(x, y), std_m=0.1)

        opened.enter_context(repeated(publish, 0.1))
        yield


def is_current(answer: httpx.Response, epoch: int) -> bool:
    return answer.is_success and answer.json()["epoch"] == epoch and answer.json()["age_s"] < 0.5


def asked_until(node: Running, site: str, epoch: int) -> list[httpx.Response]:
    """Ask for the pose of a cart until it is a current one of this epoch. Return all answers."""
    answers: list[httpx.Response] = []
    with httpx.Client(base_url=node.url, trust_env=False, verify=False) as client:
        while not answers or not is_current(answers[-1], epoch):
            answers.append(client.get(f"/api/v1/sites/{site}/tags/cart/pose"))
            time.sleep(0.02)
    return answers


def test_two_nodes_show_all_sites_through_a_move_a_death_and_an_outage_of_the_database(
    cluster: Cluster, capsys: pytest.CaptureFixture[str]
) -> None:
    one, other = cluster.nodes
    wait_until(lambda: [site["site"] for site in one.get("/api/v1/sites")["sites"]] == SITES)
    one.put("/api/v1/sites/019.south/anchors/9", {"id": "9", "x": 4.0})
    assert [anchor["id"] for anchor in other.get("/api/v1/sites/019.south/anchors")["anchors"]] == ["7", "9"]
    standby = cluster.start("018", "018-b")
    with driving_carts(cluster, "017.north", "018.north"):
        for node in cluster.nodes:
            asked_until(node, "017.north", 1)
            asked_until(node, "018.north", 1)
        with connect(cluster.url, "test") as connection:
            wait_until(lambda: "standby of 018" in standby.ask("GET", "/api/v1/health/ready").text)
            leases.set_moving(connection, "018", True)
        moved = asked_until(one, "018.north", 2)
        third = cluster.start("018", "018-c")
        wait_until(lambda: "the owner is 018-b" in third.ask("GET", "/api/v1/health/ready").text)
        standby.process.kill()
        died = asked_until(one, "018.north", 3)
        cluster.database.stop()
        wait_until(lambda: "goes on with the owners of" in one.ask("GET", "/api/v1/health/ready").text)
        assert len(asked_until(one, "018.north", 3)) == 1
        cluster.database.start()
        wait_until(lambda: other.get("/api/v1/health/ready")["impaired"] == [])
    refused = [answer for answer in (*moved, *died) if not answer.is_success]
    slowest_s = max(answer.elapsed.total_seconds() for answer in moved)
    with capsys.disabled():
        sys.stdout.write(
            f"\nmove: {len(moved)} answers, the slowest in {slowest_s:.2f} s; death: {len(refused)} refused\n"
        )
    held_s = next((answer.elapsed.total_seconds() for answer in moved if not answer.is_success), HOLD_S)
    assert held_s > 0.5 * HOLD_S  # in a move nobody is refused who was not held first
    assert {(answer.status_code, answer.headers["retry-after"]) for answer in refused} <= {(503, "1")}
    assert all("018" in answer.json()["detail"] for answer in refused)
    for answers in (moved, died):
        epochs = [answer.json()["epoch"] for answer in answers if answer.is_success]
        assert epochs == sorted(epochs)


@pytest.mark.browser
def test_the_page_of_a_node_leads_from_the_overview_to_a_moving_dot(
    cluster: Cluster, shared_chromium: PausedBrowser
) -> None:
    with ExitStack() as opened:
        browser = opened.enter_context(shared_chromium.driven())
        opened.enter_context(driving_carts(cluster, "019.north"))
        node = cluster.nodes[0]
        watched = opened.enter_context(open_page(browser, f"{node.url}/"))
        page = watched.page
        expect(page.locator("#sites tr")).to_have_count(len(SITES))
        page.locator("a[data-site='019.north']").click()
        watched.wait_for("window.dropanchor?.status() === 'live'")
        watched.wait_for("dropanchor.tags().some((tag) => tag.tag === 'cart' && tag.semiMajor > 0)")
        place = "dropanchor.tags().find((tag) => tag.tag === 'cart').pixel"
        x, y = page.evaluate(place)
        watched.wait_for(f"Math.hypot({place}[0] - {x}, {place}[1] - {y}) > 20")
        assert watched.origins == {node.url}
        assert watched.errors == []
        cluster.owners["017"].process.kill()
        page.goto(f"{node.url}/sites/")
        expect(page.locator("#unavailable")).to_have_text(
            "Nobody serves the sites of 017 now, so they are missing here."
        )
        expect(page.locator("#sites tr")).to_have_count(4)

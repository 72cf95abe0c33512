"""What a node does with a request while the site changes its owner."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Timer

import httpx
import pytest
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from dropanchor_service.api.http.of_cluster import NamesOwner
from dropanchor_service.api.starting import create_starting_app
from dropanchor_service.node.owners import HOLD_S, Owner
from support.api import kind_of
from support.api_nodes import BareNode, running_owner
from support.http_server import running_server
from support.sites import app_of_sites, make_sites
from support.zenoh_router import free_port

POSES, SAMPLES = "/api/v1/poses", "/api/v1/ingest/samples"


class Counting:
    """An application that counts its requests. name: its answer. before: what happens until it answers."""

    def __init__(self, name: str, before: Callable[[], object] = lambda: None) -> None:
        self.requests: list[str] = []
        self._name = name
        self._before = before

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.requests.append(scope["method"])
        self._before()
        await PlainTextResponse(self._name)(scope, receive, send)


@contextmanager
def at(owner_app: ASGIApp, epoch: int) -> Iterator[Owner]:
    """Serve an application as it is, at an address that the table gives to the owner of this epoch."""
    with running_server(owner_app, Event()) as port:
        yield Owner("yard", epoch, f"owner {epoch}", f"http://127.0.0.1:{port}")


@contextmanager
def node_before(owner: Owner) -> Iterator[tuple[BareNode, httpx.Client]]:
    """Run a node that has just seen this owner take its bucket over."""
    node = BareNode()
    with (
        node.running(Owner("yard", 1, "first", "")) as url,
        httpx.Client(base_url=url, trust_env=False, timeout=20.0) as client,
    ):
        node.take(owner)
        yield node, client


def test_requests_share_a_connection_to_the_owner() -> None:
    ports = set()

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        ports.add(scope["client"][1])
        await PlainTextResponse(300_000 * "x")(scope, receive, send)

    with at(NamesOwner(app, "yard", 2), 2) as owner, node_before(owner) as (_, client):
        assert [len(client.get(POSES).text) for _ in range(5)] == [300_000] * 5
    assert len(ports) == 1


@pytest.mark.parametrize(("method", "path"), [("GET", POSES), ("POST", SAMPLES)])
def test_what_did_not_arrive_waits_for_the_successor(method: str, path: str) -> None:
    dead, second = Owner("yard", 2, "dead", f"http://127.0.0.1:{free_port()}"), Counting("second")
    standby = create_starting_app(lambda: "This process takes yard over.")
    with at(standby, 3) as starting, running_owner(second, "yard", 4) as successor, node_before(dead) as (node, client):
        node.take(starting)
        timer = Timer(0.2, node.take, [successor])
        timer.start()
        answer = client.request(method, path)
        timer.join()
    assert (answer.status_code, answer.text, second.requests) == (200, "second", [method])
    assert node.metrics.repeated._value.get() >= 1.0


def test_what_may_have_arrived_is_sent_once_more_only_if_it_changes_nothing() -> None:
    second, cut = Counting("second"), Counting("", before=_fail)
    with at(cut, 2) as first, running_owner(second, "yard", 3) as successor, node_before(first) as (node, client):
        refused = client.post(SAMPLES)
        timer = Timer(0.2, node.take, [successor])
        timer.start()
        answer = client.get(POSES)
        timer.join()
    assert (kind_of(refused), answer.text) == ("not-ready", "second")
    assert (cut.requests[0], set(cut.requests[1:]), second.requests) == ("POST", {"GET"}, ["GET"])


def _fail() -> None:
    raise RuntimeError("the connection ends before the answer")


def test_an_answer_of_a_former_owner_is_dropped() -> None:
    former, newest = Counting("former"), Counting("newest")
    with (
        running_owner(former, "yard", 4) as first,
        running_owner(newest, "yard", 5) as second,
        node_before(first) as (
            node,
            client,
        ),
    ):
        assert client.get(POSES).text == "former"
        node.take(Owner("yard", 5, "b", first.address))  # a table that gives a wrong address
        timer = Timer(0.2, node.take, [Owner("yard", 5, "b", second.address)])
        timer.start()
        assert client.get(POSES).text == "newest"
        timer.join()
        assert node.metrics.dropped._value.get() >= 1.0
    assert former.requests.count("GET") >= 2


def test_an_owner_that_does_not_answer_is_left_once_it_has_a_successor() -> None:
    frozen = Event()
    slow = Counting("slow", before=lambda: frozen.wait(20.0))
    with running_owner(Counting("second"), "yard", 3) as successor, running_owner(slow, "yard", 2) as first:
        with node_before(first) as (node, client):
            timer = Timer(0.2, node.take, [successor])
            timer.start()
            began_s = time.monotonic()
            assert client.get(POSES).text == "second"
            assert time.monotonic() - began_s < 10.0
            timer.join()
        frozen.set()


def test_a_bucket_that_stays_without_an_owner_is_refused_after_a_while_and_then_at_once() -> None:
    dead = Owner("yard", 2, "dead", f"http://127.0.0.1:{free_port()}")
    with node_before(dead) as (_, client):
        times = []
        for _ in range(2):
            began_s = time.monotonic()
            refused = client.get(POSES)
            times.append(time.monotonic() - began_s)
            assert (kind_of(refused), refused.headers["retry-after"]) == ("not-ready", "1")
        assert times[0] > 0.5 * HOLD_S > times[1]


def test_a_web_socket_ends_when_its_site_has_a_new_owner() -> None:
    app = app_of_sites(make_sites("a"), stopping=Event())
    with running_owner(app, "yard", 2) as owner, node_before(owner) as (node, client):
        url = f"ws{str(client.base_url).removeprefix('http').rstrip('/')}/api/v1/ingest/stream?tag=anna"
        with connect(url, proxy=None) as socket:
            socket.recv(timeout=10.0)
            node.take(Owner("yard", 3, "b", owner.address))
            with pytest.raises(ConnectionClosed) as closed:
                socket.recv(timeout=10.0)
        with connect(url, proxy=None) as socket, pytest.raises(ConnectionClosed) as refused:
            socket.recv(timeout=10.0)
    for end in (closed, refused):
        assert end.value.rcvd is not None
        assert (end.value.rcvd.code, end.value.rcvd.reason) == (1012, "yard has another owner now. Connect again.")

"""What a node does with a request while the site changes its owner."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

import httpx
import pytest
from prometheus_client import Counter
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from dropanchor_service.api.http.limits import GuardedProtocol
from dropanchor_service.api.http.of_cluster import NamesOwner
from dropanchor_service.api.starting import create_starting_app
from dropanchor_service.node.owners import Owner
from support.api import kind_of
from support.api_nodes import BareNode, running_owner
from support.http_server import running_server
from support.patience import PATIENCE_S
from support.sites import app_of_sites, make_sites
from support.zenoh_router import free_port, wait_until

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
        httpx.Client(base_url=url, trust_env=False, verify=False) as client,
    ):
        node.take(owner)
        yield node, client


@contextmanager
def once(condition: Callable[[], object], act: Callable[[], object]) -> Iterator[None]:
    """Act as soon as the condition holds, while the block runs."""

    def wait_and_act() -> None:
        wait_until(condition)
        act()

    thread = Thread(target=wait_and_act)
    thread.start()
    yield
    thread.join()


def count_of(counter: Counter) -> float:
    return float(counter._value.get())


class CountedConnections(GuardedProtocol):
    """Counts the connections to a server. The ports of its clients say nothing: a node hides them."""

    made = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        CountedConnections.made += 1
        super().connection_made(transport)


def test_requests_share_a_connection_to_the_owner(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CountedConnections, "made", 0)
    app = NamesOwner(PlainTextResponse(300_000 * "x"), "yard", 2)
    with (
        running_server(app, Event(), protocol=CountedConnections) as port,
        node_before(Owner("yard", 2, "owner", f"http://127.0.0.1:{port}")) as (_, client),
    ):
        assert [len(client.get(POSES).text) for _ in range(5)] == [300_000] * 5
    assert CountedConnections.made == 1


@pytest.mark.parametrize(("method", "path"), [("GET", POSES), ("POST", SAMPLES)])
def test_what_did_not_arrive_waits_for_the_successor(method: str, path: str) -> None:
    dead, second = Owner("yard", 2, "dead", f"http://127.0.0.1:{free_port()}"), Counting("second")
    standby = create_starting_app(lambda: "This process takes yard over.")
    with at(standby, 3) as starting, running_owner(second, "yard", 4) as successor, node_before(dead) as (node, client):
        node.take(starting)
        with once(lambda: count_of(node.metrics.repeated) >= 1.0, lambda: node.take(successor)):
            answer = client.request(method, path)
    assert (answer.status_code, answer.text, second.requests) == (200, "second", [method])


def test_what_may_have_arrived_is_sent_once_more_only_if_it_changes_nothing() -> None:
    second, cut = Counting("second"), Counting("", before=_fail)
    with at(cut, 2) as first, running_owner(second, "yard", 3) as successor, node_before(first) as (node, client):
        refused = client.post(SAMPLES)
        with once(lambda: "GET" in cut.requests, lambda: node.take(successor)):
            answer = client.get(POSES)
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
        successor = Owner("yard", 5, "b", second.address)
        with once(lambda: count_of(node.metrics.dropped) >= 1.0, lambda: node.take(successor)):
            assert client.get(POSES).text == "newest"
    assert former.requests.count("GET") >= 2


def test_an_owner_that_does_not_answer_is_left_once_it_has_a_successor() -> None:
    frozen = Event()
    slow = Counting("slow", before=lambda: frozen.wait(20.0))
    with running_owner(Counting("second"), "yard", 3) as successor, running_owner(slow, "yard", 2) as first:
        with node_before(first) as (node, client), once(lambda: slow.requests, lambda: node.take(successor)):
            assert client.get(POSES).text == "second"
        frozen.set()


def test_a_bucket_that_stays_without_an_owner_is_refused_after_a_while_and_then_at_once() -> None:
    dead = Owner("yard", 2, "dead", f"http://127.0.0.1:{free_port()}")
    with node_before(dead) as (node, client):
        attempts = []
        for _ in range(2):
            refused = client.get(POSES)
            attempts.append(count_of(node.metrics.repeated))
            assert (kind_of(refused), refused.headers["retry-after"]) == ("not-ready", "1")
        assert attempts[0] == attempts[1] >= 2.0


def test_a_web_socket_ends_when_its_site_has_a_new_owner() -> None:
    app = app_of_sites(make_sites("a"), stopping=Event())
    with running_owner(app, "yard", 2) as owner, node_before(owner) as (node, client):
        url = f"ws{str(client.base_url).removeprefix('http').rstrip('/')}/api/v1/ingest/stream?tag=anna"
        with connect(url, proxy=None) as socket:
            socket.recv(PATIENCE_S)
            node.take(Owner("yard", 3, "b", owner.address))
            with pytest.raises(ConnectionClosed) as closed:
                socket.recv(PATIENCE_S)
        with connect(url, proxy=None) as socket, pytest.raises(ConnectionClosed) as refused:
            socket.recv(PATIENCE_S)
    for end in (closed, refused):
        assert end.value.rcvd is not None
        assert (end.value.rcvd.code, end.value.rcvd.reason) == (1012, "yard has another owner now. Connect again.")

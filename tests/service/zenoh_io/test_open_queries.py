"""Answers of caches hold up no live message, however many there are and however slowly they are taken."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event

import zenoh

from dropanchor_schemas.keys import samples_key
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.zenoh_io.caches import MAX_OPEN, ZenohCaches
from dropanchor_service.zenoh_io.open_queries import OpenQueries
from dropanchor_tag_client import TagClient
from support.sites import make_sites
from support.zenoh_router import connected_session, wait_until

KEY = samples_key("default", "a")
CACHED = 600  # more than the 256 replies that Zenoh's own channel for a callback holds


class WatchedCatchUp(CatchUp):
    """on_first: called before the first cached message after `on_first_round_answer`. answers: by key."""

    def __init__(self, caches: ZenohCaches, on_first: Callable[[], object]) -> None:
        super().__init__(MessageBuffer(10**8), [], lambda _: {}, caches.ask, 10)
        self.on_first = on_first
        self.answers: Counter[str] = Counter()
        self.replies = 0
        self.ready = Event()

    def on_first_round_answer(self, limit: int) -> int:
        released = super().on_first_round_answer(limit)
        self.ready.set()
        return released

    def on_cached(self, *_: object) -> None:
        if self.ready.is_set():
            self.replies += 1
            if self.replies == 1:
                self.on_first()

    def on_answer(self, key: str, _limit: int) -> int:
        self.answers[key] += 1
        return 0


@contextmanager
def caches_and_catch_up(session: zenoh.Session, on_first: Callable[[], object]) -> Iterator[WatchedCatchUp]:
    """Ask all caches, and yield when they have answered."""
    caches = ZenohCaches(session, make_sites(), Metrics(), UtcClock())
    catch_up = WatchedCatchUp(caches, on_first)
    caches.start(catch_up)
    try:
        wait_until(catch_up.ready.is_set)
        yield catch_up
    finally:
        caches.stop()


@contextmanager
def tag_with_a_cache(endpoint: str) -> Iterator[TagClient]:
    with TagClient("a", connect=endpoint, batch_samples=1, cache_messages=CACHED) as tag:
        for _ in range(CACHED):
            tag.publish_range(7, 10.0)
        yield tag


def test_live_messages_come_although_nobody_takes_what_the_caches_answer(router_endpoint: str) -> None:
    go_on, live = Event(), list[str]()
    with (
        connected_session(router_endpoint) as session,
        connected_session(router_endpoint) as other,
        tag_with_a_cache(router_endpoint),
        caches_and_catch_up(session, go_on.wait) as catch_up,
    ):
        subscriber = session.declare_subscriber("live", lambda message: live.append(str(message.key_expr)))
        publisher = other.declare_publisher("live")
        wait_until(lambda: publisher.matching_status)
        try:
            catch_up._ask(KEY, CACHED, 0)
            wait_until(lambda: catch_up.replies)
            publisher.put(b"")
            wait_until(lambda: live)
            assert not catch_up.answers
        finally:
            go_on.set()
        wait_until(lambda: catch_up.answers[KEY])
        assert catch_up.replies == CACHED
        subscriber.undeclare()


def test_more_queries_than_may_be_open_are_all_answered(router_endpoint: str) -> None:
    keys = [samples_key("default", f"tag-{number}") for number in range(3 * MAX_OPEN)]
    with (
        connected_session(router_endpoint) as session,
        caches_and_catch_up(session, lambda: None) as catch_up,
    ):
        for key in keys:
            catch_up._ask(key, 1, 0)
        wait_until(lambda: len(catch_up.answers) == len(keys))
        assert set(catch_up.answers.values()) == {1}


def test_a_reply_that_cannot_be_taken_costs_neither_the_others_nor_the_end(router_endpoint: str) -> None:
    taken: list[int] = []
    ends: list[int] = []

    def take(_reply: object) -> None:
        taken.append(1)
        if len(taken) == 1:
            raise ValueError("the first one")

    queries = OpenQueries()
    with connected_session(router_endpoint) as session, tag_with_a_cache(router_endpoint):
        replies = session.get(
            f"{KEY}/@adv/**",
            zenoh.handlers.FifoChannel(CACHED),
            consolidation=zenoh.ConsolidationMode.NONE,
            accept_replies=zenoh.ReplyKeyExpr.ANY,
        )
        queries.add(replies, take, lambda: ends.append(1))
        wait_until(lambda: fails(queries))
        wait_until(lambda: polled(queries, ends))
    assert len(taken) == CACHED
    assert ends == [1]
    assert not queries


def fails(queries: OpenQueries) -> bool:
    """Poll, and return whether that raises the error of the first reply."""
    try:
        queries.poll()
    except ValueError:
        return True
    return False


def polled(queries: OpenQueries, ends: list[int]) -> bool:
    queries.poll()
    return bool(ends)

"""A tag that falls silent is asked for its newest message until its cache has answered."""

import threading

import numpy as np
import pytest
import zenoh

from dropanchor_schemas.keys import samples_key
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.zenoh_io import caches as module
from dropanchor_service.zenoh_io.caches import ZenohCaches
from support.sites import make_sites
from support.zenoh_router import connected_session, wait_until

KEY = samples_key("default", "a")


class Cache:
    """A cache that does not answer the first query in time."""

    def __init__(self, session: zenoh.Session) -> None:
        self._late: list[zenoh.Query] = []
        self._queryable = session.declare_queryable(f"{KEY}/@adv/**", self._on_query, complete=True)

    def _on_query(self, query: zenoh.Query) -> None:
        if not str(query.parameters).startswith("_max=1;"):
            return
        if not self._late:
            self._late.append(query)  # it stays open
        else:
            query.reply(KEY, b"newest")


class NewestMessages(CatchUp):
    def __init__(self, caches: ZenohCaches) -> None:
        super().__init__(MessageBuffer(1000), [], lambda _: {}, caches.ask, 10)
        self.first_round, self.newest = threading.Event(), list[bytes]()

    def on_first_round_answer(self, limit: int) -> int:
        self.first_round.set()
        return super().on_first_round_answer(limit)

    def on_newest(self, _key: str, payload: bytes, _encoding: str) -> None:
        self.newest.append(payload)


def test_a_cache_that_was_late_is_asked_again(router_endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "ANSWER_S", 0.5)
    monkeypatch.setattr(module, "CHECK_S", 0.1)
    sites, clock = make_sites(), UtcClock()
    with connected_session(router_endpoint) as session, connected_session(router_endpoint) as of_tag:
        cache = Cache(of_tag)
        caches = ZenohCaches(session, sites, Metrics(), clock)
        catch_up = NewestMessages(caches)
        caches.start(catch_up)
        try:
            wait_until(catch_up.first_round.is_set)
            site = sites[0]
            row = site.tags.register("a").row
            site.tags.presence.set_token("a", True)
            sites.rows.count_messages(np.array([row], np.int32), clock.now_ns())
            wait_until(lambda: catch_up.newest)
        finally:
            caches.stop()
    assert (catch_up.newest, len(cache._late)) == ([b"newest"], 1)

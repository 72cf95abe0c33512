"""What the caches of tags are asked for: few messages, and behind the live ones."""

import numpy as np
import zenoh

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import ENCODING_PACKED
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.store.sites import Sites
from dropanchor_service.zenoh_io.caches import MIN_MESSAGES, SPARE_MESSAGES, ZenohCaches
from dropanchor_tag_client.publisher import declare_publisher
from support.manual_clock import ManualClock
from support.sites import make_sites
from support.traffic import T0_NS
from support.zenoh_router import connected_session, wait_until

SECOND_NS = 1_000_000_000
SILENT_S, RATE = 4, 5


def key_of(tag: str) -> str:
    return samples_key("default", tag)


def sites_with_a_tag(name: str) -> Sites:
    """Return sites with a tag that sent RATE messages per second for 100 s."""
    sites = make_sites()
    row = sites[0].tags.register(name).row
    for number in range(100 * RATE + 1):
        sites.rows.count_messages(np.array([row], np.int32), T0_NS + number * SECOND_NS // RATE)
    return sites


class Limits:
    """A cache that notes how many messages it is asked for."""

    def __init__(self, session: zenoh.Session, tag: str) -> None:
        self.asked: list[int] = []
        self._queryable = session.declare_queryable(f"{key_of(tag)}/@adv/**", self._on_query, complete=True)

    def _on_query(self, query: zenoh.Query) -> None:
        name, _, limit = str(query.parameters).partition(";")[0].partition("=")
        assert name == "_max"
        self.asked.append(int(limit))


def test_a_cache_is_asked_for_what_its_tag_has_sent_since_it_was_heard(router_endpoint: str) -> None:
    sites, clock = sites_with_a_tag("a"), ManualClock(T0_NS + (100 + SILENT_S) * SECOND_NS)
    with connected_session(router_endpoint) as session, connected_session(router_endpoint) as of_tags:
        known, new = Limits(of_tags, "a"), Limits(of_tags, "b")
        caches = ZenohCaches(session, sites, Metrics(), clock)
        for tag in ("a", "b"):  # the start asks once only
            with session.declare_querier(f"{key_of(tag)}/@adv/**") as querier:
                wait_until(lambda querier=querier: querier.matching_status.matching)  # type: ignore[misc]
        caches.start(CatchUp(MessageBuffer(1000), [], lambda _: {}, caches.ask, 10))
        try:
            wait_until(lambda: known.asked and new.asked)
            for tag, missing in (("a", 0), ("a", 7), ("b", 0)):
                caches.ask(key_of(tag), missing, 0)
            wait_until(lambda: len(known.asked) == 3 and len(new.asked) == 2)
        finally:
            caches.stop()
    assert RATE * SILENT_S <= known.asked[1] <= 2 * RATE * SILENT_S + SPARE_MESSAGES
    assert known.asked[2] == 7 + SPARE_MESSAGES
    assert new.asked[1] == MIN_MESSAGES


def test_answers_of_a_cache_come_behind_live_messages(router_endpoint: str) -> None:
    """Zenoh gives a reply the priority of its query, whatever the publisher wants."""
    with connected_session(router_endpoint) as session, connected_session(router_endpoint) as of_tag:
        publisher = declare_publisher(of_tag, key_of("a"), ENCODING_PACKED, cache_messages=1, wait_when_congested=False)
        publisher.put(b"live")
        caches = ZenohCaches(session, make_sites(), Metrics(), ManualClock())
        found: list[zenoh.Priority] = []

        def has_answered() -> bool:
            found.extend(reply.ok.priority for reply in caches._get(key_of("a"), 1) if reply.ok)
            return bool(found)

        wait_until(has_answered)
        publisher.undeclare()
    assert found == [zenoh.Priority.DATA_LOW]

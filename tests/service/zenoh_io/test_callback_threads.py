"""Python waits at its end for the threads of Zenoh that run the service's callbacks; it would abort among them.

Zenoh starts such a thread for each callback. It is a daemon, for which Python does not wait, if the thread that
declares the callback is one.
"""

import threading
from typing import Any

import zenoh

from dropanchor_schemas.keys import samples_key
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.zenoh_io.caches import ZenohCaches
from dropanchor_service.zenoh_io.link import ZenohLink
from dropanchor_tag_client import TagClient
from support.sites import make_sites
from support.zenoh_router import connected_session, wait_until


def test_the_parts_of_the_service_are_not_opened_by_a_daemon(router_endpoint: str) -> None:
    daemons: list[bool] = []

    def parts(_session: object) -> list[Any]:
        daemons.append(threading.current_thread().daemon)
        return []

    with ZenohLink(ZenohSettings(connect=(router_endpoint,)), parts, samples_key("default", "-")):
        wait_until(lambda: daemons)
    assert daemons == [False]


class RecordingCatchUp(CatchUp):
    """daemons: whether each cached message came on a daemon."""

    daemons: list[bool]

    def on_cached(self, *_: object) -> None:
        self.daemons.append(threading.current_thread().daemon)


def test_no_daemon_receives_what_caches_answer(router_endpoint: str) -> None:
    key = samples_key("default", "a")
    with connected_session(router_endpoint) as session, TagClient("a", connect=router_endpoint) as tag:
        tag.publish_range(1, 1.0)
        tag.flush()
        # Until the router knows the tag's cache: the service asks it once here, and would get no answer before.
        wait_until(lambda: list(session.get(f"{key}/@adv/**", accept_replies=zenoh.ReplyKeyExpr.ANY)))
        caches = ZenohCaches(session, make_sites(), Metrics(), UtcClock())
        catch_up = RecordingCatchUp(MessageBuffer(1000), [], lambda _: {}, caches.ask, 10)
        catch_up.daemons = []
        caches.start(catch_up)
        try:
            caches.ask(key, 0, 0)
            wait_until(lambda: len(catch_up.daemons) >= 2)
        finally:
            caches.stop()
    assert not any(catch_up.daemons)

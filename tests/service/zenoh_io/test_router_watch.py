"""A link that is up but brings nothing is noticed. One that is down is not taken for such a link."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from threading import Event, Thread

import pytest
import zenoh

from dropanchor_schemas.keys import tag_alive_key
from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.zenoh_io import router_watch
from dropanchor_service.zenoh_io.channel import drain_now
from dropanchor_service.zenoh_io.link import ZenohLink
from dropanchor_service.zenoh_io.router_watch import RouterWatch
from support.zenoh_router import connected_session, free_endpoint, start_router_process, wait_until

KEY = tag_alive_key("default", "-")
MESSAGES = 2000  # of 1 kB. While nobody takes them, Zenoh's thread that receives for the session waits


@pytest.fixture(autouse=True)
def _asks_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(router_watch, "PERIOD_S", 0.01)
    monkeypatch.setattr(router_watch, "ANSWER_S", 0.5)


class Blocking:
    """A subscriber whose messages nobody takes until `go_on`."""

    def __init__(self, session: zenoh.Session) -> None:
        self._subscriber = session.declare_subscriber("blocking", zenoh.handlers.FifoChannel(1))

    def go_on(self) -> bool:
        """Take what has come, and return True."""
        return all(True for _ in drain_now(self._subscriber.handler))


@contextmanager
def link_to(endpoint: str, on_session: Callable[[zenoh.Session], object]) -> Iterator[ZenohLink]:
    def parts(session: zenoh.Session) -> list[AbstractContextManager[object]]:
        on_session(session)
        return []

    with ZenohLink(ZenohSettings(connect=(endpoint,)), parts, KEY) as link:
        yield link


def has_answered(link: ZenohLink) -> bool:
    return link._watch is not None and link._watch._has_answered


def fill(endpoint: str) -> None:
    with connected_session(endpoint) as session:
        publisher = session.declare_publisher("blocking", congestion_control=zenoh.CongestionControl.DROP)
        wait_until(lambda: publisher.matching_status)
        for _ in range(MESSAGES):
            publisher.put(bytes(1000))


def test_a_session_that_receives_nothing_is_deaf_until_it_receives_again(router_endpoint: str) -> None:
    blocking: list[Blocking] = []
    with link_to(router_endpoint, lambda session: blocking.append(Blocking(session))) as link:
        wait_until(partial(has_answered, link))
        assert (link.problem, link.is_deaf) == (None, False)
        fill(router_endpoint)
        wait_until(lambda: link.is_deaf)
        assert link.problem == "the Zenoh router does not answer although it is connected"
        wait_until(lambda: blocking[0].go_on() and not link.is_deaf)
        assert link.problem is None


def test_a_session_without_a_router_is_not_deaf() -> None:
    endpoint = free_endpoint()
    router = start_router_process(endpoint)
    with link_to(endpoint, lambda _: None) as link:
        wait_until(partial(has_answered, link))
        router.kill()
        router.communicate()
        wait_until(lambda: link.problem == "there is no connection to the Zenoh router")
        assert not link.is_deaf


def test_a_router_that_has_never_answered_may_forbid_the_question(router_endpoint: str) -> None:
    with connected_session(router_endpoint) as session:
        blocking, stop = Blocking(session), Event()
        fill(router_endpoint)
        watch = RouterWatch(session, KEY, stop)
        thread = Thread(target=watch.run)
        thread.start()
        asked = [watch._is_answered() for _ in range(router_watch.UNANSWERED)]
        stop.set()
        thread.join()
        assert (asked, watch.is_deaf) == ([False] * router_watch.UNANSWERED, False)
        blocking.go_on()

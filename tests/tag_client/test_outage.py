"""A router is killed and restarted: the samples published in the meantime still arrive."""

import resource
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest

from dropanchor_tag_client import TagClient
from support.listening import ReceivedFrames, listening, listening_with_recovery
from support.zenoh_router import free_endpoint, start_router_process, wait_until

DURING = range(100, 220)  # the samples of the outage


class KillableRouter:
    def __init__(self) -> None:
        self.endpoint = free_endpoint()
        self._process = start_router_process(self.endpoint)

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()

    def restart(self) -> None:
        self._process = start_router_process(self.endpoint)


@pytest.fixture
def router() -> Iterator[KillableRouter]:
    router = KillableRouter()
    yield router
    router.kill()


def publish_through_an_outage(tag: TagClient, router: KillableRouter, heard: ReceivedFrames) -> int:
    """Publish before and during an outage, and then until the newest arrives. Return the number of samples."""
    numbers = count()

    def arrives() -> bool:
        number = next(numbers)
        tag.publish_range(1, float(number))
        time.sleep(0.01)
        return any(heard_number > DURING.stop for heard_number in heard.ranges())

    for number in range(DURING.stop):
        if number == DURING.start:
            router.kill()
        arrives()
    router.restart()
    wait_until(arrives)
    return next(numbers)


def test_a_killed_router_loses_nothing(router: KillableRouter) -> None:
    with listening_with_recovery(router.endpoint) as heard, TagClient("a", connect=router.endpoint) as tag:
        published = publish_through_an_outage(tag, router, heard)
        wait_until(lambda: len(heard.ranges()) >= published)
    assert heard.ranges() == [float(i) for i in range(published)]


def test_without_a_cache_the_same_outage_loses_samples(router: KillableRouter) -> None:
    with listening(router.endpoint) as heard, TagClient("a", connect=router.endpoint, cache_messages=0) as tag:
        publish_through_an_outage(tag, router, heard)
    assert len(set(DURING) & set(heard.ranges())) < len(DURING) / 2


def test_publishing_waits_neither_for_a_router_that_has_died_nor_for_the_disk(
    router: KillableRouter, tmp_path: Path
) -> None:
    for spool in (None, tmp_path):
        with TagClient("a", connect=router.endpoint, spool=spool) as tag:
            router.kill()
            before = waits()
            for number in range(1000):
                tag.publish_range(1, float(number))
            assert waits() - before < 500  # each call would wait, and a few wait for the other threads of Python
        router.restart()


def waits() -> int:
    return resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw

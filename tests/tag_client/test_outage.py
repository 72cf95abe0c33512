"""A router is killed and restarted: the samples published in the meantime still arrive."""

import time
from collections.abc import Iterator

import pytest

from dropanchor_tag_client import TagClient
from support.listening import listening, listening_with_recovery
from support.zenoh_router import free_endpoint, start_router_process, wait_until


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


def publish_through_an_outage(tag: TagClient, router: KillableRouter) -> int:
    """Publish 100 samples per second with an outage of more than a second. Return the number of samples."""
    for i in range(300):
        if i == 100:
            router.kill()
        if i == 220:
            router.restart()
        tag.publish_range(1, float(i))
        time.sleep(0.01)
    return 300


def test_a_killed_router_loses_nothing(router: KillableRouter) -> None:
    with listening_with_recovery(router.endpoint) as heard, TagClient("a", connect=router.endpoint) as tag:
        published = publish_through_an_outage(tag, router)
        wait_until(lambda: len(heard.ranges()) >= published)
    assert heard.ranges() == [float(i) for i in range(published)]


def test_without_a_cache_the_same_outage_loses_samples(router: KillableRouter) -> None:
    with listening(router.endpoint) as heard, TagClient("a", connect=router.endpoint, cache_messages=0) as tag:
        publish_through_an_outage(tag, router)
        wait_until(lambda: 299.0 in heard.ranges())
    assert len(heard.ranges()) < 250


def test_publishing_does_not_block_during_an_outage(router: KillableRouter) -> None:
    with TagClient("a", connect=router.endpoint) as tag:
        router.kill()
        began = time.monotonic()
        for i in range(1000):
            tag.publish_range(1, float(i))
        assert time.monotonic() - began < 20.0
        closing = time.monotonic()
    assert time.monotonic() - closing < 15.0

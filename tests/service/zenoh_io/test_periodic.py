"""A thread that publishes survives errors and stops with its context."""

import logging
import threading
import time

import pytest

from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.may_serve import MayServe, always
from dropanchor_service.zenoh_io.periodic import PeriodicPublisher
from support.zenoh_router import wait_until


class FailsFirst(PeriodicPublisher):
    """Fails at the first call."""

    def __init__(self, metrics: Metrics, may_publish: MayServe = always) -> None:
        super().__init__("numbers", 0.001, metrics, may_publish)
        self.calls: list[int] = []

    def publish(self) -> None:
        self.calls.append(len(self.calls))
        if len(self.calls) == 1:
            raise OSError("the network is down")


def test_an_error_is_counted_and_logged_and_does_not_end_the_calls(caplog: pytest.LogCaptureFixture) -> None:
    metrics = Metrics()
    with caplog.at_level(logging.ERROR), FailsFirst(metrics) as publisher:
        publisher.wake()
        wait_until(lambda: len(publisher.calls) == 2)
        publisher.wake()
        wait_until(lambda: len(publisher.calls) == 3)
    assert metrics.registry.get_sample_value("dropanchor_faults_total", {"where": "publication"}) == 1
    assert [record.getMessage() for record in caplog.records] == [
        "publication of numbers: OSError: the network is down"
    ]


def test_nothing_is_published_while_the_process_may_not_serve() -> None:
    asked: list[bool] = []

    def may_publish() -> bool:
        asked.append(len(asked) >= 3)
        return asked[-1]

    with FailsFirst(Metrics(), may_publish) as publisher:
        publisher.wake()
        wait_until(lambda: len(publisher.calls) == 2)
    assert asked == [False, False, False, True, True]


def test_it_sleeps_until_there_is_something_and_then_calls_once() -> None:
    with FailsFirst(Metrics()) as publisher:
        publisher.wake()
        wait_until(lambda: len(publisher.calls) == 2)  # the first failed
        time.sleep(0.05)
        assert len(publisher.calls) == 2
        for _ in range(3):
            publisher.wake()
        wait_until(lambda: len(publisher.calls) > 2)


def test_its_thread_ends_with_the_context() -> None:
    with FailsFirst(Metrics()):
        assert "numbers" in {thread.name for thread in threading.enumerate()}
    assert "numbers" not in {thread.name for thread in threading.enumerate()}

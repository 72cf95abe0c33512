"""Texts that repeat within a second are logged once."""

import logging
import time

import pytest

from dropanchor_tag_client.sources.throttled_log import throttled_log


@pytest.fixture
def now_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return a clock that stands still: its one element is the time."""
    clock = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    return clock


def test_texts_that_alternate_are_each_logged_once_per_second(
    now_s: list[float], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    log = throttled_log()
    for _ in range(10):
        log("the bus fails")
        log("the chip is opened again")
    assert caplog.messages == ["the bus fails", "the chip is opened again"]
    now_s[0] += 1.0
    log("the bus fails")
    assert caplog.messages[2:] == ["the bus fails"]

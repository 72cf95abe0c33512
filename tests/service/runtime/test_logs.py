"""Repeated events do not flood the log."""

import logging

import pytest

from dropanchor_service.runtime.logs import REPEAT_S, RareLog


def test_repeated_events_are_logged_rarely_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    now = 0.0
    log = RareLog(logging.getLogger("test"), clock=lambda: now)
    for _ in range(100):
        log.warning("link", "gone")
        log.warning("disk", "full")
    now = REPEAT_S + 1
    log.warning("link", "gone")
    assert [record.getMessage() for record in caplog.records] == [
        "link: gone",
        "disk: full",
        "link: gone (and 99 more like it)",
    ]


def test_a_traceback_is_logged_only_once(caplog: pytest.LogCaptureFixture) -> None:
    now = 0.0
    log = RareLog(logging.getLogger("test"), clock=lambda: now)
    for now in (0.0, 2 * REPEAT_S):  # noqa: B007
        log.exception("engine", ValueError("bad"))
    assert [bool(record.exc_info) for record in caplog.records] == [True, False]

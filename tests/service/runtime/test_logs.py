"""Repeated events do not flood the log."""

import io
import logging

import pytest

from dropanchor_service.runtime.logs import REPEAT_S, RareLog, configure
from dropanchor_service.runtime.repeats import LINES, WINDOW_S, CountingHandler


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


class CountedLog:
    """A logger with a handler that counts. now_s: its time."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self._stream = io.StringIO()
        self.handler = CountingHandler(self._stream, clock=lambda: self.now_s)
        self.logger = logging.Logger("test")
        self.logger.addHandler(self.handler)

    def lines(self) -> list[str]:
        return self._stream.getvalue().splitlines()


def test_a_line_that_repeats_is_written_once_and_counted_for_a_minute() -> None:
    log = CountedLog()
    for _ in range(1000):
        log.logger.error("no file is left")
        log.now_s += 0.01
    assert log.lines() == ["no file is left"]
    log.now_s += WINDOW_S
    log.logger.error("another line")
    assert log.lines()[1:] == ["repeated 999 times in the last minute: no file is left", "another line"]


def test_a_traceback_that_repeats_is_written_once() -> None:
    log = CountedLog()
    for _ in range(1000):
        try:
            raise OSError(24, "Too many open files")
        except OSError:
            log.logger.exception("socket.accept() out of system resource")
    assert sum(line.startswith("Traceback") for line in log.lines()) == 1


def test_lines_that_differ_in_their_values_only_are_counted_after_the_first_ones() -> None:
    log = CountedLog()
    for number in range(20_000):
        log.logger.warning("the tag %s is unknown", f"tag-{number}")
    assert len(log.lines()) == LINES
    log.handler.close()
    assert log.lines()[LINES:] == [
        f"repeated {20_000 - LINES:,} times in the last minute: the tag tag-0 is unknown",
    ]


def test_the_log_has_no_urls_of_webhooks() -> None:
    root = logging.getLogger()
    before, level = root.handlers[:], root.level
    try:
        configure("DEBUG")
        assert not logging.getLogger("httpx").isEnabledFor(logging.INFO)
    finally:
        root.handlers[:] = before
        root.setLevel(level)

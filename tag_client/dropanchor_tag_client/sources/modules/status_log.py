"""Log what happens to the data of a module, at most once per second."""

import logging
import time
from collections import Counter

from dropanchor_tag_client.sources.modules.heard import visible
from dropanchor_tag_client.sources.modules.report import Drop, Dropped, Report

_log = logging.getLogger(__name__)
_INTERVAL_S, _MAX_INTERVAL_S = 1.0, 60.0
_NO_ANCHOR_AFTER_S = 2.0
_MAX_PENDING = 32

_EXPECTED = {Drop.UNCORRECTED, Drop.ANCHOR_TO_ANCHOR, Drop.WITHOUT_RANGE, Drop.REPEATED}
_HEARD = (Drop.NEGATIVE, Drop.ABSURD, Drop.NO_ANSWER, Drop.DAMAGED, Drop.REPEATED)
_HINTS = {
    Drop.NEGATIVE: "distances below zero: calibrate the module's antenna delay",
    Drop.ABSURD: "not a distance: an overflow, or the mark of a measurement that failed",
    Drop.NO_ANSWER: "the other side did not answer: is it on, and set up alike?",
    Drop.POSITION_ONLY: "the module prints positions without ranges: `lec` prints ranges",
    Drop.NOT_UNDERSTOOD: "if no range comes at all: the right --module and --baud? --pattern describes such lines",
    Drop.OTHER_FRAME: "the module sends another protocol: choose NodeFrame 2 or 3",
}


class StatusLog:
    """Collect messages, and log them at most once per second: all that came, each once.

    ranges, imu: numbers of published samples.
    """

    def __init__(self) -> None:
        self.ranges = 0
        self.imu = 0
        self._pending: dict[str, None] = {}
        self._next_s = 0.0
        self._logged_drops: Counter[Drop] = Counter()
        self._next_drops_s, self._drops_interval_s = 0.0, _INTERVAL_S
        self._empty_since_s: float | None = None
        self._refused = 0
        self._lonely_interval_s = _NO_ANCHOR_AFTER_S

    def add(self, text: str) -> None:
        """Log the text as soon as the rate allows."""
        if len(self._pending) < _MAX_PENDING:
            self._pending[text] = None

    def add_report(self, report: Report, dropped: Dropped) -> None:
        """Say after a while, and then at growing intervals, that a module reports no anchor at all.

        dropped: what was left out so far. An anchor whose range was left out was heard.
        """
        refused = sum(dropped[reason] for reason in _HEARD)
        if report.ranges or report.imu is not None or refused > self._refused:
            self._refused, self._empty_since_s, self._lonely_interval_s = refused, None, _NO_ANCHOR_AFTER_S
            return
        now_s = time.monotonic()
        if self._empty_since_s is None:
            self._empty_since_s = now_s
        elif now_s - self._empty_since_s > self._lonely_interval_s:
            self._empty_since_s = now_s
            self._lonely_interval_s = min(2 * self._lonely_interval_s, _MAX_INTERVAL_S)
            self.add(
                "the module hears no anchor: it reports, but no distance. Is an anchor on, near, and set up alike?"
            )

    def add_dropped(self, dropped: Dropped) -> None:
        """Log what was left out since the last time, at growing intervals while the reasons stay the same."""
        recent = {reason: dropped[reason] - self._logged_drops[reason] for reason in dropped if reason not in _EXPECTED}
        recent = {reason: count for reason, count in recent.items() if count}
        if not recent:
            return
        is_new = any(not self._logged_drops[reason] for reason in recent)
        now_s = time.monotonic()
        if now_s < (self._next_s if is_new else self._next_drops_s):
            return
        self._drops_interval_s = _INTERVAL_S if is_new else min(2 * self._drops_interval_s, _MAX_INTERVAL_S)
        self._next_drops_s = now_s + self._drops_interval_s
        self._logged_drops = Counter(dropped)
        shown = f', the last "{visible(dropped.line)}"' if Drop.NOT_UNDERSTOOD in recent and dropped.line else ""
        self.add(f"left out: {_counts(recent)}{shown}{''.join(f' ({_HINTS[r]})' for r in recent if r in _HINTS)}")

    def write(self, *, is_last: bool = False) -> None:
        """Log what came since the last time, if that was long enough ago or there is no next time."""
        now_s = time.monotonic()
        if self._pending and (is_last or now_s >= self._next_s):
            self._next_s = now_s + _INTERVAL_S
            texts, self._pending = "\n".join(self._pending), {}  # first: a signal may end the program while it logs
            _log.info("%s", texts)

    def summary(self, dropped: Counter[Drop]) -> str:
        """Return one sentence about everything that was published and left out."""
        left_out = f"; left out: {_counts(dropped)}" if dropped.total() else ""
        return f"{self.ranges} ranges and {self.imu} IMU samples published{left_out}"


def _counts(dropped: Counter[Drop] | dict[Drop, int]) -> str:
    return ", ".join(f"{reason.value} {count}" for reason, count in sorted(dropped.items()) if count)

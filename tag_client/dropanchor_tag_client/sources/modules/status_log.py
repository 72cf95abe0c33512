"""Log what happens to the data of a module, at most once per second."""

import logging
import time
from collections import Counter

from dropanchor_tag_client.sources.modules.report import Drop

_log = logging.getLogger(__name__)
_INTERVAL_S, _MAX_DROPPED_INTERVAL_S = 1.0, 60.0

_EXPECTED = {Drop.UNCORRECTED, Drop.ANCHOR_TO_ANCHOR}
_HINTS = {
    Drop.NEGATIVE: "distances below zero: calibrate the module's antenna delay",
    Drop.NO_ANSWER: "the other side did not answer: is it on, and set up alike?",
    Drop.POSITION_ONLY: "the module prints positions without ranges: `lec` prints ranges",
    Drop.NOT_UNDERSTOOD: "if no range comes at all: is it the right --module, and the right --baud?",
    Drop.OTHER_FRAME: "the module sends another protocol: choose NodeFrame 2 or 3",
}


class StatusLog:
    """Log messages with a limited rate. Of the messages that come too early, only the last is logged, later."""

    def __init__(self) -> None:
        self.ranges = 0
        self.imu = 0
        self._pending: str | None = None
        self._next_s = 0.0
        self._logged_drops: Counter[Drop] = Counter()
        self._next_drops_s, self._drops_interval_s = 0.0, _INTERVAL_S

    def add(self, text: str) -> None:
        """Log the text, now or as soon as the rate allows."""
        self._pending = text
        self._write_pending()

    def add_dropped(self, dropped: Counter[Drop]) -> None:
        """Log what was left out since the last time, at growing intervals while the reasons stay the same."""
        self._write_pending()
        recent = {reason: dropped[reason] - self._logged_drops[reason] for reason in dropped if reason not in _EXPECTED}
        recent = {reason: count for reason, count in recent.items() if count}
        if not recent or self._pending is not None:
            return
        is_new = any(not self._logged_drops[reason] for reason in recent)
        now_s = time.monotonic()
        if now_s < (self._next_s if is_new else self._next_drops_s):
            return
        self._drops_interval_s = _INTERVAL_S if is_new else min(2 * self._drops_interval_s, _MAX_DROPPED_INTERVAL_S)
        self._next_drops_s = now_s + self._drops_interval_s
        self._logged_drops = Counter(dropped)
        self.add(f"left out: {_counts(recent)}{''.join(f' ({_HINTS[r]})' for r in recent if r in _HINTS)}")

    def summary(self, dropped: Counter[Drop]) -> str:
        """Return one sentence about everything that was published and left out."""
        left_out = f"; left out: {_counts(dropped)}" if dropped.total() else ""
        return f"{self.ranges} ranges and {self.imu} IMU samples published{left_out}"

    def _write_pending(self) -> None:
        now_s = time.monotonic()
        if self._pending is not None and now_s >= self._next_s:
            self._next_s = now_s + _INTERVAL_S
            _log.info("%s", self._pending)
            self._pending = None


def _counts(dropped: Counter[Drop] | dict[Drop, int]) -> str:
    return ", ".join(f"{reason.value} {count}" for reason, count in sorted(dropped.items()) if count)

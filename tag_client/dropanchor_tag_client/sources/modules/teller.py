"""Tells a person what a module says, at most once per second."""

import logging
import time
from collections import Counter

from dropanchor_tag_client.sources.modules.report import Drop

_log = logging.getLogger(__name__)
_SAY_EVERY_S, _DROPPED_AT_MOST_S = 1.0, 60.0

_EXPECTED = {Drop.UNCORRECTED, Drop.ANCHOR_TO_ANCHOR}
_HINTS = {
    Drop.NEGATIVE: "distances below zero: calibrate the module's antenna delay",
    Drop.NO_ANSWER: "the other side did not answer: is it on, and set up alike?",
    Drop.POSITION_ONLY: "the module prints positions without ranges: `lec` prints ranges",
    Drop.NOT_UNDERSTOOD: "if no range comes at all: is it the right --module, and the right --baud?",
    Drop.OTHER_FRAME: "the module sends another protocol: choose NodeFrame 2 or 3",
}


class Teller:
    """What is said too soon after something else waits; of what waits, the last is said."""

    def __init__(self) -> None:
        self.ranges = 0
        self.imu = 0
        self._waiting: str | None = None
        self._next_s = 0.0
        self._told: Counter[Drop] = Counter()
        self._tell_s, self._pause_s = 0.0, _SAY_EVERY_S

    def say(self, text: str) -> None:
        self._waiting = text
        self._speak()

    def tell_dropped(self, dropped: Counter[Drop]) -> None:
        """Tell what was left out since the last time, ever more seldom while it is the same."""
        self._speak()
        news = {reason: dropped[reason] - self._told[reason] for reason in dropped if reason not in _EXPECTED}
        news = {reason: count for reason, count in news.items() if count}
        if not news or self._waiting is not None:
            return
        is_new = any(not self._told[reason] for reason in news)
        now_s = time.monotonic()
        if now_s < (self._next_s if is_new else self._tell_s):
            return
        self._pause_s = _SAY_EVERY_S if is_new else min(2 * self._pause_s, _DROPPED_AT_MOST_S)
        self._tell_s = now_s + self._pause_s
        self._told = Counter(dropped)
        self.say(f"left out: {_counts(news)}{''.join(f' ({_HINTS[r]})' for r in news if r in _HINTS)}")

    def summary(self, dropped: Counter[Drop]) -> str:
        left_out = f"; left out: {_counts(dropped)}" if dropped.total() else ""
        return f"{self.ranges} ranges and {self.imu} IMU samples published{left_out}"

    def _speak(self) -> None:
        now_s = time.monotonic()
        if self._waiting is not None and now_s >= self._next_s:
            self._next_s = now_s + _SAY_EVERY_S
            _log.info("%s", self._waiting)
            self._waiting = None


def _counts(dropped: Counter[Drop] | dict[Drop, int]) -> str:
    return ", ".join(f"{reason.value} {count}" for reason, count in sorted(dropped.items()) if count)

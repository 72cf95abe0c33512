"""The service's clock."""

import time

from dropanchor_schemas.sentences import say

NAMED_NS = 2_000_000_000  # a smaller correction is nothing to mend


class UtcClock:
    """UTC of the host at the start, advanced by the monotonic clock. Later steps of the host's clock have no effect.

    correction_ns: what has been added, because the tags or a checkpoint tell another time. is_behind: whether the host
    showed an earlier time than a checkpoint, so that it is wrong for certain. is_settled: whether the correction is
    more than the least that a checkpoint tells.
    """

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()
        self.correction_ns = 0
        self.is_behind = False
        self.is_settled = True

    def now_ns(self) -> int:
        """Return the current UTC in ns."""
        return time.monotonic_ns() + self._offset_ns + self.correction_ns

    def step(self, by_ns: int) -> None:
        """Set the clock forward, or back if `by_ns` is negative. The ingest thread calls this, or nobody runs yet."""
        self.correction_ns += by_ns
        self.is_behind = self.is_behind and self.correction_ns != 0

    def go_on_from(self, t_ns: int) -> int:
        """Set the clock forward to the time of a checkpoint if that is later. Return by how much, ns."""
        by_ns = t_ns - self.now_ns()
        if by_ns <= NAMED_NS:
            return 0
        self.step(by_ns)
        self.is_behind, self.is_settled = True, False
        return by_ns

    @property
    def problem(self) -> str | None:
        """Return what is wrong with the clock of the host, None if nothing is known."""
        if abs(self.correction_ns) <= NAMED_NS:
            return None
        return say(
            "host_clock",
            "the clock of this machine is {time} {side} the one of its tags. The service goes on with theirs: set the "
            "clock of this machine",
            time=duration(self.correction_ns),
            side=ahead_or_behind(self.correction_ns < 0),
        )


def duration(ns: int) -> str:
    """Return how long a time is, either way, in a unit that people use for it."""
    seconds = abs(ns) * 1e-9
    if seconds < 120:
        return say("seconds_long", "{n} s", n=f"{seconds:.0f}")
    if seconds < 7200:
        return say("minutes", "{n} minutes", n=f"{seconds / 60:.0f}")
    if seconds < 172_800:
        return say("hours", "{n} hours", n=f"{seconds / 3600:.0f}")
    return say("days", "{n} days", n=f"{seconds / 86_400:.0f}")


def ahead_or_behind(is_ahead: bool) -> str:
    return say("ahead_of", "ahead of") if is_ahead else say("behind", "behind")

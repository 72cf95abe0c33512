"""Tell an overload, in which messages wait longer and longer, from a backlog that is being worked off."""

from typing import NamedTuple

CALM_NS = 2_000_000_000  # an overload ends after this time without shedding


class _Behind(NamedTuple):
    """When a turn first left messages behind, and how long the oldest one had waited by then."""

    since_ns: int
    waited_ns: int


class Overload:
    """Judges after each turn that left messages behind.

    patience_ns: how long turns must be behind, and by how much longer the oldest message must wait than at first.
    may_shrink: a backlog that is smaller than it was at its largest is no overload.
    """

    def __init__(self, patience_ns: int, *, may_shrink: bool = False) -> None:
        self._patience_ns = patience_ns
        self._may_shrink = may_shrink
        self._behind: _Behind | None = None
        self._most = 0  # messages left behind, since it fell behind
        self._drained_bytes = 0  # since it fell behind
        self._shed_ns = 0  # UTC of the last shedding
        self.bytes_per_ns = 0.0  # drained while it was behind
        self.is_on = False

    def judge(self, now_ns: int, waited_ns: int, left: int) -> bool:
        """Return whether this is an overload. waited_ns: by the oldest message. left: number of messages."""
        if self._behind is None:
            self._behind, self._drained_bytes, self._most = _Behind(now_ns, waited_ns), 0, 0
        self._most = max(self._most, left)
        behind_ns = now_ns - self._behind.since_ns
        if self._drained_bytes and behind_ns > 0:
            self.bytes_per_ns = self._drained_bytes / behind_ns
        if min(behind_ns, waited_ns - max(0, self._behind.waited_ns)) > self._patience_ns:
            self.is_on = self.is_on or not self._may_shrink or left == self._most
        return self.is_on

    def note_drained(self, size: int) -> None:
        """Note that a turn took messages of this size."""
        self._drained_bytes += size if self._behind else 0

    def note_shed(self, now_ns: int) -> None:
        self._shed_ns = now_ns

    def end(self) -> None:
        """Begin anew."""
        self._behind, self.is_on = None, False

    def caught_up(self, now_ns: int) -> None:
        """Note that a turn left nothing behind. An overload ends when that lasts for a while."""
        self._behind, self.is_on = None, self.is_on and now_ns - self._shed_ns < CALM_NS

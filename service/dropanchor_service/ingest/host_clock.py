"""Find out whether a tag's clock is off, or that of the host: what most tags share is the host's.

Each tag tells by how much its clock differs from that of the service: the least of arrival minus time, see
`kernels/utc_clocks.py`. The service's clock is moved to the time on which more than half of the tags agree, if they are
more than agree with it now. The host's own clock counts as one of them, unless a checkpoint shows that it went back. So
a single tag never outvotes the host, and a tag that is alone with its time is off.

The move changes no time of an estimator and no time of a pose, but for those from the future.
"""

import logging
from collections.abc import Callable

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.kernels.sequences import PER_TAG
from dropanchor_service.ingest.kernels.utc_clocks import LATE_NS, NEAR_NS, STEADY_NS
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.store import Rows

LOOK_NS = 5_000_000_000  # time between two looks whether a correction still holds

_log = logging.getLogger(__name__)


def step_of(differences_ns: Array, doubted_ns: Array, correction_ns: int, host_counts: bool) -> int:
    """Return by how much to move the service's clock, ns; 0 if it is right as far as anybody knows.

    differences_ns: by how much it is ahead of that of each tag. doubted_ns: those of clocks that are off for certain.
    correction_ns: by how much the clock was moved from that of the host. host_counts: whether the host's clock counts.
    """

    def votes(step_ns: int) -> int:
        moved_ns = differences_ns + step_ns
        agree = np.count_nonzero((moved_ns >= -NEAR_NS) & (moved_ns <= LATE_NS))
        return int(agree) + (host_counts and step_ns == -correction_ns)

    now = votes(0)
    if correction_ns and votes(-correction_ns) > now:
        return -correction_ns
    early = np.median(differences_ns) if correction_ns and len(differences_ns) else 0
    if -NEAR_NS <= early < -STEADY_NS:  # the first message, which told the correction, had waited for longer
        return -int(early)
    if not len(doubted_ns):
        return 0
    agreeing = differences_ns[np.abs(differences_ns - np.median(doubted_ns)) <= NEAR_NS]
    return -int(agreeing.min()) if len(agreeing) > now and 2 * len(agreeing) > len(differences_ns) else 0


class HostClock:
    """Owned by the ingest thread.

    rows: get the errors of the tags' clocks. moved: called after the clock was moved, with by how much, ns.
    """

    def __init__(self, clock: UtcClock, publishers: Publishers, rows: Rows, moved: Callable[[int], None]) -> None:
        self._clock = clock
        self._publishers = publishers
        self._rows = rows
        self._moved = moved
        self._looked_ns = 0

    def now_ns(self) -> int:
        """Return the current UTC in ns."""
        return self._clock.now_ns()

    @property
    def is_settled(self) -> bool:
        """Whether nobody needs to call `settle`."""
        return self._clock.is_settled

    def settle(self, slots: Array, newest_ns: Array, arrivals_ns: Array) -> int:
        """Find out how long the service was away if the host does not know. Return by how much the clock was moved, ns.

        The first message of a publisher in the checkpoint tells. slots: of the publishers of these messages.
        """
        known = np.flatnonzero(self._publishers.columns["arrival_ns"][slots] != 0)
        if not len(known):
            return 0
        self._clock.is_settled = True
        first, before = known[0], self._publishers.columns[slots[known[0]]]
        away_ns = int(newest_ns[first] - before["newest_ns"]) - int(arrivals_ns[first] - before["arrival_ns"])
        if away_ns <= 0:
            return 0
        self._clock.step(away_ns)
        self._moved(away_ns)
        return away_ns

    def look(self, doubted: Array) -> int:
        """Judge the clocks of these publishers, which are off. Return by how much the clock was moved, ns."""
        now_ns = self.now_ns()
        if not len(doubted) and abs(now_ns - self._looked_ns) < LOOK_NS:
            return 0
        self._looked_ns = now_ns
        in_doubt = len(doubted) or self._clock.correction_ns or self._rows.clock_errors
        step_ns = self._judge(doubted, now_ns) if in_doubt else 0
        self._rows.clock_errors = self._publishers.clock_errors(now_ns + step_ns)
        return step_ns

    def _judge(self, doubted: Array, now_ns: int) -> int:
        """Move our clock or correct those of the publishers. Return by how much ours was moved, ns."""
        by_row = self._publishers.differences(now_ns)
        asked = {*(doubted // PER_TAG).tolist(), *self._rows.clock_errors}
        step_ns = step_of(
            np.array(list(by_row.values()), np.int64),
            np.array([by_row[row] for row in asked if row in by_row], np.int64),
            self._clock.correction_ns,
            host_counts=not self._clock.is_behind,
        )
        if step_ns:
            self._move(step_ns)
        else:
            self._publishers.follow_lags(doubted)
        return step_ns

    def _move(self, step_ns: int) -> None:
        before = self._clock.problem
        self._clock.step(step_ns)
        self._publishers.move(step_ns)
        self._moved(step_ns)
        if self._clock.problem != before:
            _log.warning("%s", self._clock.problem or "the clock of this machine is right again, by its tags")

"""How the samples of each tag arrive: how late, in bursts or steadily, and how many ranges."""

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.records import enlarged, take

BURST_S = 1.0  # least silence before a burst
RANGE_WINDOW_S = 6.0  # over which the ranges of a tag are counted
DELAY_GROWTH = 0.5  # s per s: how fast the least delay of late may grow, so that one late message says nothing
LATE_S, BURSTS, RANGE_S = 1.0, 3, 1.5  # delay, bursts and time between ranges from which on a tag is conspicuous
ZEROS = 5  # the same for ranges of 0
FORGOTTEN_BURSTS = 3.0  # silences without a burst after which a tag no longer sends in bursts

ARRIVAL = np.dtype(
    [
        ("arrival_ns", "i8"),  # of the newest message; 0: none yet
        ("newest_ns", "i8"),  # time of the newest sample
        ("delay_s", "f8"),  # the least of late from the time of a message's newest sample to its arrival
        ("burst_ns", "i8"),  # arrival of the newest burst
        ("burst_s", "f8"),  # the silence before it, which its samples fill
        ("bursts", "i4"),  # one after another
        ("counted_ns", "i8"),  # since when ranges are counted
        ("ranges", "i4"),  # that were counted
        ("range_s", "f8"),  # mean time between two ranges; 0: not known yet
        ("range_ns", "i8"),  # arrival of the newest range to an anchor of the site
        ("motion_ns", "i8"),  # arrival of the newest IMU sample or heading
        ("newest_imu_ns", "i8"),  # time of the newest IMU sample
        ("newest_range_ns", "i8"),  # time of the newest range
        ("zeros", "i4"),  # ranges of 0 since the last other one
    ]
)


class Arrivals:
    """ARRIVAL by row of a tag. The ingest thread writes, with `record_arrivals`; any thread reads.

    columns: ARRIVAL. are_conspicuous: whether the samples arrive late, in bursts, with few ranges or with zeros.
    """

    def __init__(self) -> None:
        self.columns = np.zeros(16, ARRIVAL)
        self.are_conspicuous = np.zeros(16, bool)

    def of(self, rows: Array) -> Array:
        """Return ARRIVAL of these rows; zeros for a tag that has sent nothing."""
        return take(self.columns, rows)

    def conspicuous(self, rows: Array) -> Array:
        """Return whether the samples of these rows arrive late, in bursts, with few ranges or with zeros."""
        found: Array = self.are_conspicuous[rows]
        return found

    def forget(self) -> None:
        """Learn how samples arrive anew, because the clock that tells arrivals was moved."""
        self.columns[:] = 0
        self.are_conspicuous[:] = False

    def grow(self, rows: int) -> None:
        """Make room for this many rows."""
        if rows > len(self.columns):
            self.columns = enlarged(self.columns, 2 * rows)
            self.are_conspicuous = enlarged(self.are_conspicuous, 2 * rows)

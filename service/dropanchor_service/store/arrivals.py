"""How the samples of each tag arrive: how late, in bursts or steadily, and how many ranges."""

from dataclasses import dataclass

import numpy as np

from dropanchor_schemas import kinds
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.records import copied, enlarged, put, take

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

_IMU, _RANGE, _HEADING = ([kind.name for kind in kinds.KINDS].index(name) for name in ("imu", "range", "heading"))


@dataclass(frozen=True)
class Arrived:
    """What one message of each of several rows, which are distinct, had.

    oldest_ns, newest_ns: times of its samples. newest_of_ns: time of the newest sample of each of `KINDS`, -1 for none;
    (kinds, rows). ranges, zeros: number of its ranges to anchors of the site, and of those that are 0.
    """

    rows: Array
    arrival_ns: Array
    oldest_ns: Array
    newest_ns: Array
    newest_of_ns: Array
    ranges: Array
    zeros: Array


class Arrivals:
    """ARRIVAL by row of a tag. The ingest thread writes; any thread reads."""

    def __init__(self) -> None:
        self._columns = np.zeros(16, ARRIVAL)
        self._conspicuous = np.zeros(16, bool)

    def of(self, rows: Array) -> Array:
        """Return ARRIVAL of these rows; zeros for a tag that has sent nothing."""
        return take(self._columns, rows)

    def conspicuous(self, rows: Array) -> Array:
        """Return whether the samples of these rows arrive late, in bursts, with few ranges or with zeros."""
        found: Array = self._conspicuous[rows]
        return found

    def grow(self, rows: int) -> None:
        """Make room for this many rows."""
        if rows > len(self._columns):
            self._columns = enlarged(self._columns, 2 * rows)
            self._conspicuous = enlarged(self._conspicuous, 2 * rows)

    def record(self, arrived: Arrived) -> None:
        """Record one message of each of several rows."""
        rows, arrival_ns, newest_ns = arrived.rows, arrived.arrival_ns, arrived.newest_ns
        was = take(self._columns, rows)
        now = copied(was)
        now["arrival_ns"], now["newest_ns"] = arrival_ns, newest_ns
        silence_s = np.where(was["arrival_ns"] == 0, 0.0, (arrival_ns - was["arrival_ns"]) * 1e-9)
        delay_s = (arrival_ns - newest_ns) * 1e-9
        now["delay_s"] = np.where(
            was["arrival_ns"] == 0, delay_s, np.minimum(delay_s, was["delay_s"] + DELAY_GROWTH * silence_s)
        )
        _count_bursts(now, was, silence_s, arrived.oldest_ns)
        _count_ranges(now, arrived.ranges, newest_ns)
        _note_kinds(now, arrived)
        put(self._columns, rows, now)
        late, few = now["delay_s"] >= LATE_S, now["range_s"] > RANGE_S
        self._conspicuous[rows] = late | few | (now["bursts"] >= BURSTS) | (now["zeros"] >= ZEROS)


def _count_bursts(now: Array, was: Array, silence_s: Array, oldest_ns: Array) -> None:
    """Update the bursts. A burst follows a silence, and its samples are of that silence."""
    filled = (oldest_ns - was["newest_ns"]) * 1e-9 < silence_s / 2
    burst = (silence_s > BURST_S) & filled
    since_s = (now["arrival_ns"] - was["burst_ns"]) * 1e-9
    again = since_s < FORGOTTEN_BURSTS * np.maximum(was["burst_s"], BURST_S)
    now["bursts"] = np.where(again, was["bursts"], 0) + burst
    now["burst_ns"] = np.where(burst, now["arrival_ns"], was["burst_ns"])
    now["burst_s"] = np.where(burst, silence_s, was["burst_s"])


def _count_ranges(now: Array, ranges: Array, newest_ns: Array) -> None:
    """Update the mean time between two ranges, which counts from the first one."""
    now["range_ns"] = np.where(ranges > 0, now["arrival_ns"], now["range_ns"])
    begins = (now["counted_ns"] == 0) & (ranges > 0)
    now["ranges"] += np.where(begins, 0, ranges)
    counted_s = (newest_ns - now["counted_ns"]) * 1e-9
    full = (now["counted_ns"] > 0) & (counted_s >= RANGE_WINDOW_S) & (ranges > 0)
    now["range_s"] = np.where(full, counted_s / np.maximum(now["ranges"], 1), now["range_s"])
    restarts = begins | full
    now["counted_ns"] = np.where(restarts, newest_ns, now["counted_ns"])
    now["ranges"] = np.where(restarts, 0, now["ranges"])


def _note_kinds(now: Array, arrived: Arrived) -> None:
    """Note when motion came, the newest time of each kind, and how many ranges of 0 came one after another."""
    imu_ns, range_ns, heading_ns = (arrived.newest_of_ns[kind] for kind in (_IMU, _RANGE, _HEADING))
    now["motion_ns"] = np.where(np.maximum(imu_ns, heading_ns) >= 0, now["arrival_ns"], now["motion_ns"])
    now["newest_imu_ns"] = np.maximum(now["newest_imu_ns"], imu_ns)
    now["newest_range_ns"] = np.where(range_ns >= 0, range_ns, now["newest_range_ns"])
    now["zeros"] = np.where(arrived.zeros == arrived.ranges, now["zeros"] + arrived.zeros, 0)

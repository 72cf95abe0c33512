"""Sum the last half minute of a tag's IMU samples and ranges in bins of 0.1 s, each on the clock of its publisher."""

from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array

BIN_S = 0.1
BIN_NS = 100_000_000
SIZE = 320  # bins
MIN_FILLED = 0.9  # share of bins with an IMU sample
AT_REST_MPS2 = 0.12  # standard deviation of the specific force; a wheeled vehicle shows 0.05 to 0.1 at rest
_GRAVITY_BINS = 41
_REST_BINS = 7
_SILENT_BINS = 50  # after which another anchor's ranges are taken


class Bins:
    """Sums of columns in a ring of bins. A sample that is older than the ring is left out."""

    def __init__(self, columns: int) -> None:
        self.newest = -1  # number of a bin: time divided by its duration
        self._numbers = np.full(SIZE, -1, np.int64)
        self._counts = np.zeros(SIZE)
        self._sums = np.zeros((SIZE, columns))

    def add(self, t_ns: Array, values: Array) -> None:
        """Add samples. values: (n, columns)."""
        numbers = t_ns // BIN_NS
        self.newest = max(self.newest, int(numbers.max()))
        kept = numbers > self.newest - SIZE
        numbers, values = numbers[kept], values[kept]
        places = numbers % SIZE
        reused = places[self._numbers[places] != numbers]
        self._counts[reused], self._sums[reused] = 0.0, 0.0
        self._numbers[places] = numbers
        np.add.at(self._counts, places, 1.0)
        np.add.at(self._sums, places, values)

    def between(self, first: int, end: int) -> tuple[Array, Array]:
        """Return counts (end - first,) and sums (end - first, columns) of the bins with these numbers."""
        numbers = np.arange(first, end)
        places = numbers % SIZE
        known = self._numbers[places] == numbers
        return self._counts[places] * known, self._sums[places] * known[:, None]


class Motion(NamedTuple):
    """yaw_rate: about the vertical, rad/s. moving: 1 while the tag moves, else 0. Both one value per bin."""

    yaw_rate: Array
    moving: Array


class TagBins:
    """The last half minute of one tag."""

    def __init__(self) -> None:
        self.imu = Bins(8)
        self.ranges = Bins(1)
        self._anchor = -1

    def add_imu(self, t_ns: Array, acc: Array, gyro: Array) -> None:
        """acc: (n, 3) m/s². gyro: (n, 3) rad/s."""
        squared = np.einsum("ij,ij->i", acc, acc)
        self.imu.add(t_ns, np.column_stack([acc, gyro, np.sqrt(squared), squared]))

    def add_ranges(self, t_ns: Array, anchor: Array, ranges: Array) -> None:
        """Add the ranges to one anchor; to another one only when that has been silent for 5 s. ranges: m."""
        own = anchor == self._anchor
        if not own.any() and int(t_ns.max()) // BIN_NS > self.ranges.newest + _SILENT_BINS:
            self._anchor, self.ranges = int(anchor[-1]), Bins(1)
            own = anchor == self._anchor
        if own.any():
            self.ranges.add(t_ns[own], ranges[own, None])

    def motion(self, first: int, end: int) -> Motion | None:
        """Return the motion in these bins, None if more than a tenth of them is empty."""
        counts, sums = self.imu.between(first, end)
        filled = np.flatnonzero(counts)
        if len(filled) < MIN_FILLED * len(counts):
            return None
        means = sums[filled] / counts[filled, None]
        bins = np.arange(len(counts))
        acc_gyro = np.column_stack([np.interp(bins, filled, column) for column in means[:, :6].T])
        up = _summed(acc_gyro[:, :3], _GRAVITY_BINS)
        up /= np.maximum(np.sqrt((up * up).sum(axis=1)), 1e-9)[:, None]
        n, norm, squared = _summed(np.column_stack([counts, sums[:, 6:]]), _REST_BINS).T
        variance = squared / np.maximum(n, 1.0) - (norm / np.maximum(n, 1.0)) ** 2
        return Motion((acc_gyro[:, 3:] * up).sum(axis=1), np.where(variance > AT_REST_MPS2**2, 1.0, 0.0))

    def mean_ranges(self, first: int, end: int) -> Array:
        """Return the mean range of each bin, m; NaN where there is none."""
        counts, sums = self.ranges.between(first, end)
        return np.where(counts > 0, sums[:, 0] / np.maximum(counts, 1.0), np.nan)


def _summed(columns: Array, width: int) -> Array:
    """Return the sums of each column over `width` bins (odd) around each bin, fewer at both ends."""
    totals = np.concatenate([np.zeros((1, columns.shape[1])), np.cumsum(columns, axis=0)])
    middle, reach = np.arange(len(columns)), width // 2
    ends, begins = np.minimum(middle + reach + 1, len(columns)), np.maximum(middle - reach, 0)
    summed: Array = totals[ends] - totals[begins]
    return summed

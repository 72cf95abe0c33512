"""Readings of one sensor over time, in columns: a recording has millions."""

from dataclasses import dataclass

import numpy as np

from dropanchor_service.estimation.columns import Array


@dataclass(frozen=True)
class Stream:
    """Readings in order of time, one for each time. t_ns: (n,) int64, UTC. values: (n, 3), or (n, k) without axes."""

    t_ns: Array
    values: Array

    def __len__(self) -> int:
        return len(self.t_ns)

    def at(self, t_ns: Array, max_gap_ns: int) -> tuple[Array, Array]:
        """Interpolate linearly at the times `t_ns` (n,). Return the values (n, 3) and whether they can be used (n,): a
        time needs readings on both sides, at most `max_gap_ns` apart."""
        if not len(self):
            return np.zeros((len(t_ns), 3)), np.zeros(len(t_ns), bool)
        after = np.searchsorted(self.t_ns, t_ns)
        right = np.minimum(after, len(self) - 1)
        exact = self.t_ns[right] == t_ns
        left = np.where(exact, right, np.maximum(right - 1, 0))
        gap_ns = self.t_ns[right] - self.t_ns[left]
        share = (t_ns - self.t_ns[left]) / np.maximum(gap_ns, 1)
        values = self.values[left] + share[:, None] * (self.values[right] - self.values[left])
        inside = exact | ((after > 0) & (after < len(self)))
        return values, inside & (gap_ns <= max_gap_ns)


def make_stream(t_ns: Array, values: Array) -> Stream:
    """Return the readings in order of time, the first one of those with the same time."""
    ordered, first = np.unique(np.asarray(t_ns, np.int64), return_index=True)
    columns = np.asarray(values, np.float64)
    return Stream(ordered, (columns if columns.ndim == 2 else columns.reshape(-1, 3))[first])


def no_readings() -> Stream:
    """Return an empty stream."""
    return Stream(np.empty(0, np.int64), np.empty((0, 3)))

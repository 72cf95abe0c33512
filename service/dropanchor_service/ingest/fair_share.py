"""Divide a bounded space fairly: owners that need less than their share get all that they need."""

from collections.abc import Sequence

import numpy as np

from dropanchor_service.estimation.columns import Array


def fair_cap(sizes: Array, target: float) -> int:
    """Return the largest share c with sum(min(size, c)) <= target."""
    left = int(target)
    ascending: Sequence[float] = np.sort(sizes[sizes > 0]).tolist()
    for index, size in enumerate(ascending):
        share = left // (len(ascending) - index)
        if size > share:
            return int(share)
        left -= int(size)
    return int(target)


def sizes_from_newest(owners: Array, sizes: Array) -> Array:
    """Return for each entry the sum of its size and the sizes of all later entries of its owner."""
    order = np.argsort(owners[::-1], kind="stable")
    ordered, summed = owners[::-1][order], np.cumsum(sizes[::-1][order])
    first = np.append(True, ordered[1:] != ordered[:-1])
    before = (summed - sizes[::-1][order])[first]
    sums = np.empty(len(owners), np.int64)
    sums[order] = summed - before[np.cumsum(first) - 1]
    return sums[::-1]

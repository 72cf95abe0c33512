"""The modes behind a pose: clusters of hypotheses with their weights, heaviest first."""

from typing import Any

import numpy as np
from numba import njit

from .layout import WORK, Work
from .manage import normalise
from .pool import load
from .summary import add_reference, cluster, moments


@njit(nogil=True)
def _heaviest(work: Work, count: int, taken: Any) -> int:
    head = -1
    for h in range(count):
        if not taken[h] and (head < 0 or work.log_weight[h] > work.log_weight[head]):
            head = h
    return head


@njit(cache=True, nogil=True)
def list_modes(row: Any, pool: Any, anchors: Any, work: Work, modes: Any) -> int:
    """Fill modes (HYPOTHESIS of `batch`) with the clusters above 1 %; returns their number."""
    count = row.count
    load(row, pool, work)
    taken, members = np.zeros(WORK, np.bool_), np.zeros(WORK, np.bool_)
    mean, cov = np.zeros(5), np.zeros((3, 3))
    if count > 0:
        normalise(work, count)
    for n in range(len(modes)):
        head = _heaviest(work, count, taken)
        weight = cluster(work, count, head, taken, members) if head >= 0 else 0.0
        if weight < 0.01:
            return n
        moments(work, count, members, head, mean, cov)
        if row.start_known == 0:
            add_reference(cov, mean[0], mean[1], (row.reference_std if row.referred == 1 else 1.8) ** 2)
        taken |= members
        mode, anchor = modes[n], anchors[row.anchor]
        mode.weight = min(weight, 1.0)
        mode.x, mode.y, mode.heading, mode.speed = mean[0] + anchor.x, mean[1] + anchor.y, mean[2], mean[3]
        mode.cov[:, :] = cov[:2, :2]
    return len(modes)

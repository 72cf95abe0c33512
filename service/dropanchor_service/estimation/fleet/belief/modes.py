"""The modes behind a pose: clusters of hypotheses with their weights, heaviest first."""

from typing import Any

from dropanchor_service.estimation.fleet.belief.mixture import normalise
from dropanchor_service.estimation.fleet.belief.pool import load
from dropanchor_service.estimation.fleet.belief.summary import add_reference, cluster, locate, moments
from dropanchor_service.estimation.fleet.compiled import njit


@njit(nogil=True)
def _heaviest(work: Any, count: int) -> int:
    head = -1
    for h in range(count):
        if not work[h].taken and (head < 0 or work[h].log_weight > work[head].log_weight):
            head = h
    return head


@njit(nogil=True)
def list_modes(row: Any, pool: Any, anchors: Any, space: Any, modes: Any) -> int:
    """Fill modes (HYPOTHESIS of `batch`) with the clusters above 1 %; returns their number."""
    count = row.count
    work, scratch = space.hypotheses, space.scratch
    mean, cov = scratch.mean, scratch.cov
    load(row, pool, work)
    for h in range(count):
        work[h].taken = False
    if count > 0:
        normalise(work, count)
        locate(work, count)
    for n in range(len(modes)):
        head = _heaviest(work, count)
        weight = cluster(work, count, head) if head >= 0 else 0.0
        if weight < 0.01:
            return n
        moments(work, count, head, scratch)
        if row.start_known == 0:
            add_reference(cov, mean[0], mean[1], (row.reference_std if row.referred == 1 else 1.8) ** 2)
        for h in range(count):
            work[h].taken |= work[h].member
        mode, anchor = modes[n], anchors[row.anchor]
        mode.weight = min(weight, 1.0)
        mode.x, mode.y, mode.heading, mode.speed = mean[0] + anchor.x, mean[1] + anchor.y, mean[2], mean[3]
        mode.cov[:, :] = cov[:2, :2]
    return len(modes)

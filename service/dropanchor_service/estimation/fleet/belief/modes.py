"""The modes behind a pose: clusters of hypotheses with their weights, heaviest first."""

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.layout import Anchors, Hypotheses, Pool, Row, Workspace
from dropanchor_service.estimation.fleet.belief.mixture import normalise
from dropanchor_service.estimation.fleet.belief.pool import load
from dropanchor_service.estimation.fleet.belief.summary import cluster, fill_positions, moments, widen_by_reference
from dropanchor_service.estimation.fleet.compiled import njit

LIGHTEST = 0.01  # weight of a mode that is listed


@njit(nogil=True)
def _heaviest(work: Hypotheses, count: int) -> int:
    head = -1
    for h in range(count):
        if not work[h].assigned and (head < 0 or work[h].log_weight > work[head].log_weight):
            head = h
    return head


@njit(nogil=True)
def list_modes(row: Row, pool: Pool, anchors: Anchors, space: Workspace, modes: Array) -> int:
    """Fill modes (HYPOTHESIS of `columns`) with the modes above 1 % of the weight. Return their number."""
    count = row.count
    work, scratch = space.hypotheses, space.scratch
    mean, cov = scratch.mean, scratch.cov
    load(row, pool, work)
    for h in range(count):
        work[h].assigned = False
    if count > 0:
        normalise(work, count)
        fill_positions(work, count)
    for n in range(len(modes)):
        head = _heaviest(work, count)
        weight = cluster(work, count, head) if head >= 0 else 0.0
        if weight < LIGHTEST:
            return n
        moments(work, count, head, scratch)
        widen_by_reference(row, scratch)
        for h in range(count):
            work[h].assigned |= work[h].in_mode
        mode, anchor = modes[n], anchors[row.anchor]
        mode.weight = min(weight, 1.0)
        mode.x, mode.y, mode.heading, mode.speed = mean[0] + anchor.x, mean[1] + anchor.y, mean[2], mean[3]
        mode.cov[:, :] = cov[:2, :2]
    return len(modes)

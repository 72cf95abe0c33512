"""Follow the hypotheses that hold at the end of the data back through those that they came from.

The predecessor of a hypothesis is the one before whose prediction is closest to it. All that the end still believes is
followed, with its weight there: the mean is that of the mode that was published, and the ellipse counts the heading
classes and guesses of the mounting angle as the published one does. So at the end of the data the smoothed pose is the
filtered one. Where most of the weight has no predecessor that it continues, the data ends there for what was before. It
ends where the tag was `tracking` only: what the filter did not trust itself says nothing about what was before.
"""

import math
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import (
    MOUNT,
    PHI,
    YAW,
    Floats,
    Hypotheses,
    Hypothesis,
    R,
    Row,
    Rows,
    Scratch,
    V,
    Workspace,
)
from dropanchor_service.estimation.fleet.belief.mixture import normalise
from dropanchor_service.estimation.fleet.belief.predict import fill_noise
from dropanchor_service.estimation.fleet.belief.start import is_in_site_frame
from dropanchor_service.estimation.fleet.belief.summary import (
    cluster,
    fill_positions,
    moments,
    spread_over_all,
    spread_over_families,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node, Nodes
from dropanchor_service.estimation.fleet.smoother.back import Trace, predict_mean, predict_moments, set_row, step_back
from dropanchor_service.estimation.fleet.tuning import Tuning

Indices: TypeAlias = npt.NDArray[np.int64]
FOLLOWED: Final = 12  # hypotheses at most
DEPTH: Final = 6.0  # log weight below the best at which one is not followed
OTHER_CLASS: Final = 9.0  # added to the distance to a hypothesis with another model of the heading reference
SLACK: Final = 0.01  # m^2, (m/s)^2
ANGLE_SLACK: Final = 1e-4  # rad^2
KEPT: Final = 0.5  # share of the weight that has to be left


@njit(nogil=True)
def _squared_from(s: Floats, x: float, y: float) -> float:
    return float((s[R] * math.cos(s[PHI]) - x) ** 2 + (s[R] * math.sin(s[PHI]) - y) ** 2)


@njit(nogil=True)
def _begin(
    work: Hypotheses, source: Indices, trace: Trace, hypotheses: Hypotheses, x: float, y: float, t: Tuning
) -> int:
    """Follow the heaviest hypotheses of a node that published (x, y) from the anchor. Return their number."""
    first, last = trace.first, trace.first + trace.count
    head, nearest, best = -1, math.inf, -math.inf
    for h in range(first, last):
        best = max(best, hypotheses[h].log_weight)
    for h in range(first, last):
        d2 = _squared_from(hypotheses[h].mean, x, y)
        if hypotheses[h].log_weight > best - t.mode_hysteresis and d2 < nearest:
            head, nearest = h, d2
    n = 0
    if head >= 0:
        source[0], n = head, 1
    floor = best
    while n < min(FOLLOWED, trace.count) and floor > best - DEPTH:
        floor = -math.inf
        chosen = -1
        for h in range(first, last):
            if hypotheses[h].log_weight > max(floor, best - DEPTH) and not (source[:n] == h).any():
                chosen, floor = h, hypotheses[h].log_weight
        if chosen >= 0:
            source[n] = chosen
            n += 1
    for j in range(n):
        work[j] = hypotheses[source[j]]
    normalise(work, n)
    return n


@njit(nogil=True)
def distance(s: Floats, P: Floats, target: Floats) -> float:
    """Return the squared distance in position, speed, yaw and mounting angle, in variances."""
    d2 = _squared_from(s, target[R] * math.cos(target[PHI]), target[R] * math.sin(target[PHI]))
    dv, dyaw, dmount = s[V] - target[V], wrap(s[YAW] - target[YAW]), wrap(s[MOUNT] - target[MOUNT])
    angles = dyaw * dyaw / (P[YAW, YAW] + ANGLE_SLACK) + dmount * dmount / (P[MOUNT, MOUNT] + ANGLE_SLACK)
    spread = P[R, R] + s[R] ** 2 * P[PHI, PHI]
    return float(d2 / (spread + SLACK) + dv * dv / (P[V, V] + SLACK) + angles)


@njit(nogil=True)
def _predecessor(
    child: Hypothesis, node: Node, before: Trace, hypotheses: Hypotheses, scratch: Scratch, enters: bool
) -> int:
    """Return the hypothesis before the node that is the likeliest one before `child`."""
    chosen, least, s = -1, math.inf, scratch.H
    for h in range(before.first, before.first + before.count):
        one = hypotheses[h]
        s[:] = one.mean
        predict_mean(s, node, scratch, enters)
        d2 = distance(s, one.cov, child.mean) - 2.0 * one.log_weight
        if one.heading_class != child.heading_class:
            d2 += OTHER_CLASS
        if one.nlos != child.nlos:
            d2 += OTHER_CLASS
        if d2 < least:
            chosen, least = h, d2
    return chosen


@njit(nogil=True)
def _step(
    space: Workspace,
    source: Indices,
    n: int,
    k: int,
    nodes: Nodes,
    traces: Array,
    known: Hypotheses,
    row: Row,
    t: Tuning,
) -> bool:
    """Step all that is followed back over node k + 1. Return whether most of its weight continues what was before."""
    node, before, after = nodes[k + 1], traces[k], traces[k + 1]
    enters = before.referred == 0 and after.referred == 1
    if before.count == 0 or before.carried != after.carried or before.referred > after.referred:
        return False
    if enters and not is_in_site_frame(node.heading_kind):
        return False
    work, scratch = space.hypotheses, space.scratch
    set_row(row, before, after)
    left = 0.0
    for j in range(n):
        if work[j].log_weight == -math.inf:
            continue
        fill_noise(scratch.decay, scratch.growth, node, row, t)
        parent = _predecessor(known[source[j]], node, before, known, scratch, enters)
        one = known[parent]
        mean, P, C = predict_moments(one, known[source[j]], node, row, after, enters, t, scratch)
        if step_back(work[j].mean, work[j].cov, one, mean, P, C):
            source[j] = parent
            left += math.exp(work[j].log_weight)
        else:
            work[j].log_weight = -math.inf
    return bool(left >= KEPT)


@njit(nogil=True)
def _describe(space: Workspace, n: int, ends: Trace, t: Tuning, point: Floats, cov: Floats) -> None:
    """Fill point and cov (3, 3) of the published mode: its mean, and the spread of all about it, as the filter does.

    ends: the trace at the end of the data, which says whether one mode was resolved there.
    """
    work, scratch = space.hypotheses, space.scratch
    fill_positions(work, n)
    head, total = 0, 0.0
    while head < n - 1 and work[head].weight == 0.0:
        head += 1
    for j in range(n):
        work[j].assigned = False
        total += work[j].weight
    cluster(work, n, head)
    moments(work, n, head, scratch)
    if ends.resolved == 1 and ends.carried == 0:
        spread_over_families(work, n, head, scratch, t.class_rejected_weight)
        total = 1.0
    else:
        spread_over_all(work, n, scratch)
    point[:] = scratch.mean[:4]
    spread = (t.walk_spread if ends.carried == 1 else 1.0) / total
    for i in range(3):
        for j in range(3):
            cov[i, j] = spread * scratch.cov[i, j]


@njit(nogil=True, cache=True)
def smooth_back(
    workspace: Rows,
    nodes: Nodes,
    traces: Array,
    hypotheses: Hypotheses,
    published: Floats,
    trusted: npt.NDArray[np.bool_],
    span: tuple[int, int, int],
    rows: Rows,
    t: Tuning,
    points: Floats,
    covs: Floats,
) -> None:
    """Fill points (n, 4) and covs (n, 3, 3) for the nodes a to b - 1.

    span: a, b and the last node of the data. published: (n, 2), x and y from the anchor. trusted: (n,), whether the
    data may end there. What no such node follows stays as it is.
    """
    a, b, end = span
    space, source = workspace[0], np.zeros(FOLLOWED, np.int64)  # of the filter's hypothesis at the node
    work, n, ends = space.hypotheses, 0, end
    for k in range(end, a - 1, -1):
        if n == 0 or not _step(space, source, n, k, nodes, traces, hypotheses, rows[0], t):
            x, y, ends = published[k, 0], published[k, 1], k
            n = _begin(work, source, traces[k], hypotheses, x, y, t) if trusted[k] else 0
        if k < b and n > 0:
            _describe(space, n, traces[ends], t, points[k], covs[k])

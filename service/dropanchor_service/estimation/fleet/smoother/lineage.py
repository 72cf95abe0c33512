"""Follow the hypotheses that hold at the end of the data back through those that they came from.

The predecessor of a hypothesis is the one before whose prediction is closest to it. All that the end still believes is
followed, with its weight there: the mean is that of the mode that was published, and the ellipse counts the heading
classes and guesses of the mounting angle as the published one does. So at the end of the data the smoothed pose is the
filtered one. Where most of the weight has no predecessor that it continues, the data ends there for what was before. It
ends where the tag was `tracking` only: what the filter did not trust itself says nothing about what was before.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import CLASSES, FAMILIES, MOUNT, PHI, YAW, Floats, N, R, Rows, V
from dropanchor_service.estimation.fleet.belief.mixture import is_mounted_otherwise
from dropanchor_service.estimation.fleet.belief.predict import fill_noise
from dropanchor_service.estimation.fleet.belief.start import is_in_site_frame
from dropanchor_service.estimation.fleet.belief.summary import course_of, planar_covariance
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node, Nodes
from dropanchor_service.estimation.fleet.smoother.back import (
    Trace,
    Traced,
    predict_mean,
    predict_moments,
    set_row,
    step_back,
)
from dropanchor_service.estimation.fleet.tuning import Tuning

FOLLOWED: Final = 12  # hypotheses at most
DEPTH: Final = 6.0  # log weight below the best at which one is not followed
OTHER_CLASS: Final = 9.0  # added to the distance to a hypothesis with another model of the heading reference
SLACK: Final = 0.01  # m^2, (m/s)^2
ANGLE_SLACK: Final = 1e-4  # rad^2
KEPT: Final = 0.5  # share of the weight that has to be left


class Followed(NamedTuple):
    """The hypotheses that are followed, the head of the published mode first."""

    mean: Floats  # (FOLLOWED, N) smoothed
    cov: Floats  # (FOLLOWED, N, N)
    source: npt.NDArray[np.int64]  # (FOLLOWED,) of the filter's hypothesis at the node
    weight: Floats  # (FOLLOWED,) 0: it continues nothing
    share: Floats  # (FOLLOWED,) in the ellipse
    point: Floats  # (FOLLOWED, 4) x, y from the anchor, course, speed
    planar: Floats  # (FOLLOWED, 3, 3) covariance of x, y, course


def make_followed() -> Followed:
    return Followed(
        np.zeros((FOLLOWED, N)),
        np.zeros((FOLLOWED, N, N)),
        np.zeros(FOLLOWED, np.int64),
        np.zeros(FOLLOWED),
        np.zeros(FOLLOWED),
        np.zeros((FOLLOWED, 4)),
        np.zeros((FOLLOWED, 3, 3)),
    )


@njit(nogil=True)
def _squared_from(s: Floats, x: float, y: float) -> float:
    return float((s[R] * math.cos(s[PHI]) - x) ** 2 + (s[R] * math.sin(s[PHI]) - y) ** 2)


@njit(nogil=True)
def _begin(f: Followed, trace: Trace, hypotheses: Array, x: float, y: float, t: Tuning) -> int:
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
        f.source[0], n = head, 1
    floor = best
    while n < min(FOLLOWED, trace.count) and floor > best - DEPTH:
        floor = -math.inf
        chosen = -1
        for h in range(first, last):
            if hypotheses[h].log_weight > max(floor, best - DEPTH) and not (f.source[:n] == h).any():
                chosen, floor = h, hypotheses[h].log_weight
        if chosen >= 0:
            f.source[n] = chosen
            n += 1
    for j in range(n):
        one = hypotheses[f.source[j]]
        f.mean[j], f.cov[j] = one.mean, one.cov
        f.weight[j] = math.exp(one.log_weight - best)
    _share(f, n, trace, hypotheses, t)
    return n


@njit(nogil=True)
def _share(f: Followed, n: int, trace: Trace, hypotheses: Array, t: Tuning) -> None:
    """Fill the shares in the ellipse: equal ones of all families that are not refuted, where one mode is resolved."""
    of_family, families = np.zeros(FAMILIES), 0
    f.weight[:n] /= np.sum(f.weight[:n])
    head = hypotheses[f.source[0]]
    for j in range(n):
        of_family[_family(hypotheses[f.source[j]], head)] += f.weight[j]
    for family in range(FAMILIES):
        families += of_family[family] > t.class_rejected_weight
    equal = trace.resolved == 1 and trace.carried == 0
    for j in range(n):
        total = of_family[_family(hypotheses[f.source[j]], head)]
        if not equal:
            f.share[j] = f.weight[j]
        else:
            f.share[j] = f.weight[j] / (total * families) if total > t.class_rejected_weight else 0.0


@njit(nogil=True)
def _family(one: Traced, head: Traced) -> int:
    return int(one.heading_class + CLASSES * (2 if is_mounted_otherwise(one, head) else one.aligned))


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
    child: Traced, node: Node, before: Trace, hypotheses: Array, decay: Floats, F: Floats, s: Floats, enters: bool
) -> int:
    """Return the hypothesis before the node that is the likeliest one before `child`."""
    chosen, least = -1, math.inf
    for h in range(before.first, before.first + before.count):
        one = hypotheses[h]
        s[:] = one.mean
        predict_mean(s, node, decay, F, enters)
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
    f: Followed, n: int, node: Node, before: Trace, after: Trace, hypotheses: Array, rows: Rows, t: Tuning
) -> bool:
    """Step all that is followed back over a node. Return whether most of its weight continues what was before."""
    row, enters = rows[0], before.referred == 0 and after.referred == 1
    if before.count == 0 or before.carried != after.carried or before.referred > after.referred:
        return False
    if enters and not is_in_site_frame(node.heading_kind):
        return False
    set_row(row, before, after)
    decay, growth, F, s = np.ones(N), np.zeros(N), np.zeros((4, N)), np.zeros(N)
    fill_noise(decay, growth, node, row, t)
    left = 0.0
    for j in range(n):
        if f.weight[j] == 0.0 and f.share[j] == 0.0:
            continue
        child = hypotheses[f.source[j]]
        parent = _predecessor(child, node, before, hypotheses, decay, F, s, enters)
        one = hypotheses[parent]
        mean, P, C = predict_moments(one, child, node, row, after, enters, t)
        if step_back(f.mean[j], f.cov[j], one, mean, P, C):
            f.source[j] = parent
            left += f.weight[j]
        else:
            f.weight[j] = f.share[j] = 0.0
    return bool(left >= KEPT)


@njit(nogil=True)
def _describe(f: Followed, n: int, carried: bool, t: Tuning, point: Floats, cov: Floats) -> None:
    """Fill point and cov (3, 3) of the published mode: its mean, and the spread of all about it."""
    head = 0
    while head < n - 1 and f.weight[head] == 0.0:
        head += 1
    for j in range(n):
        s, own = f.mean[j], f.point[j]
        own[0], own[1] = s[R] * math.cos(s[PHI]), s[R] * math.sin(s[PHI])
        own[2], own[3] = course_of(s), s[V]
        planar_covariance(s, f.cov[j], f.planar[j])
    reach = 1.0 + 2.0 * math.sqrt(max(f.planar[head, 0, 0] + f.planar[head, 1, 1], 0.0))
    total, d = 0.0, np.zeros(4)
    point[:] = 0.0
    for j in range(n):
        d[:] = f.point[j] - f.point[head]
        d[2] = wrap(d[2])
        if math.hypot(d[0], d[1]) <= reach:
            total += f.weight[j]
            point += f.weight[j] * d
    point /= total
    point += f.point[head]
    total = 0.0
    cov[:] = 0.0
    for j in range(n):
        d[:] = f.point[j] - point
        d[2] = wrap(d[2])
        total += f.share[j]
        cov += f.share[j] * (f.planar[j] + np.outer(d[:3], d[:3]))
    cov /= total
    point[2] = wrap(point[2])
    if carried:
        cov *= t.walk_spread


@njit(nogil=True, cache=True)
def smooth_back(
    f: Followed,
    nodes: Nodes,
    traces: Array,
    hypotheses: Array,
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
    n = 0
    for k in range(end, a - 1, -1):
        if n == 0 or not _step(f, n, nodes[k + 1], traces[k], traces[k + 1], hypotheses, rows, t):
            n = _begin(f, traces[k], hypotheses, published[k, 0], published[k, 1], t) if trusted[k] else 0
        if k < b and n > 0:
            _describe(f, n, traces[k].carried == 1, t, points[k], covs[k])

"""A place that ranges to three anchors tell at once, whatever the tag does and wherever it looks.

Least squares on d_i = |p - a_i|: the differences of their squares are linear in p and give the first guess, which
Gauss-Newton refines. J = sum u u^T / sigma_i^2 with the directions u to the anchors; its inverse is the covariance.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.births.forgetting import NOISE, forget
from dropanchor_service.estimation.fleet.belief.gap import SPEED_CHANGE
from dropanchor_service.estimation.fleet.belief.layout import FIX_SLOTS, PHI, Anchor, Anchors, Hypothesis, R, Row
from dropanchor_service.estimation.fleet.belief.publish import LARGE_M, RERESOLVE_AFTER
from dropanchor_service.estimation.fleet.belief.start import horizontal_distance, start_distance, starts_at_place
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import NO_HEADING, RANGE, Node

LEAST: Final = 3  # anchors
TOGETHER_NS: Final = 1_500_000_000  # ns in which their ranges come
LEAST_SPREAD: Final = 1.0  # m^2, of the anchors across the line through them: a place beside a line has a mirror image
ROUNDS: Final = 6
WORST: Final = 9.0  # sum of squares of what is left, in variances, up to which the ranges agree
LARGEST_HEIGHT_STD: Final = 1.0  # m, with which a range still tells a horizontal distance
PATIENCE_S: Final = 5.0  # s for which a tag whose start is told waits for a heading
APART: Final = 4.0  # standard deviations between its track and a new place that contradict it
RUN: Final = 8  # ranges in a row with a contradiction: a wrong one is in as many places as there are anchors
DOUBT_NS: Final = 10_000_000_000  # ns after such a run for which no place is believed: at some, wrong ranges agree
NEAR: Final = 1.0  # m


@njit(nogil=True)
def is_fixed_anew(one: Hypothesis, row: Row, node: Node, anchors: Anchors) -> bool:
    """Return whether a tag that started without a heading starts again. one: its heaviest hypothesis.

    It does where it has a heading now or was not heard for long, where ranges contradict each other or the track, and
    near the anchor from which distance and bearing count: there another one is better.
    """
    start = row.start
    if start.free == 0:
        return False
    if node.kind == RANGE:
        _note(row, node)
        x, y, variance, misfit = _solved(row, node, anchors)
        _count(row, node, misfit, _is_off(one, anchors[row.anchor], x, y, variance))
    heard = node.heading_kind == NO_HEADING and node.dt_s < RERESOLVE_AFTER
    again = not heard or start.fix_run > RUN or one.mean[R] < NEAR
    if again:
        start.free = start.fix_run = start.known = start.after_gap = 0
    return bool(again)


@njit(nogil=True)
def _is_off(one: Hypothesis, anchor: Anchor, x: float, y: float, variance: float) -> bool:
    """Return whether a place contradicts a track."""
    s, P = one.mean, one.cov
    off = math.hypot(anchor.x + s[R] * math.cos(s[PHI]) - x, anchor.y + s[R] * math.sin(s[PHI]) - y)
    return off > APART * math.sqrt(variance + P[R, R] + s[R] ** 2 * P[PHI, PHI])


@njit(nogil=True)
def _count(row: Row, node: Node, misfit: float, is_off: bool) -> None:
    """Count the ranges in a row with a contradiction. Without enough anchors there is none."""
    start = row.start
    if not math.isfinite(misfit):
        return
    start.fix_run = min(start.fix_run + 1, RUN + 1) if misfit > WORST or is_off else 0
    if misfit > WORST and start.fix_run > RUN:
        start.contradicted_ns = node.t_ns


@njit(nogil=True)
def start_at_fix(row: Row, node: Node, anchors: Anchors) -> bool:
    """Note the range of the node, and set the start where the last ranges agree, unless it is known. Return whether."""
    start = row.start
    if node.kind != RANGE or row.settings.height_std > LARGEST_HEIGHT_STD:
        return False
    _note(row, node)
    if starts_at_place(row) and (node.heading_kind != NO_HEADING or start.collected_s < PATIENCE_S):
        return False
    x, y, variance, misfit = _solved(row, node, anchors)
    _count(row, node, misfit, False)
    doubted = start.contradicted_ns > 0 and node.t_ns - start.contradicted_ns < DOUBT_NS
    if doubted or not (misfit < WORST and variance < LARGE_M**2):
        return False
    start.known, start.after_gap = 1, 0
    start.x, start.y, start.std = x, y, math.sqrt(variance)
    start.heading = start.other_x = math.nan
    start.speed_std = SPEED_CHANGE
    if node.heading_kind == NO_HEADING:
        row.anchor = _farthest(row, node)
        forget(row, NOISE)
    return True


@njit(nogil=True)
def _farthest(row: Row, node: Node) -> int:
    """Return the anchor of the longest of the last ranges: near an anchor, the bearing from it jumps."""
    start, best = row.start, -1
    for k in range(FIX_SLOTS):
        if _is_fresh(row, node, k) and (best < 0 or start.fix_z[k] > start.fix_z[best]):
            best = k
    return int(start.fix_anchor[best])


@njit(nogil=True)
def _note(row: Row, node: Node) -> None:
    """Keep the node's range in the slot of its anchor, else in the oldest one."""
    start, slot = row.start, 0
    for k in range(1, FIX_SLOTS):
        if start.fix_t_ns[k] < start.fix_t_ns[slot]:
            slot = k
    for k in range(FIX_SLOTS):
        if start.fix_t_ns[k] > 0 and start.fix_anchor[k] == node.anchor:
            slot = k
    start.fix_anchor[slot], start.fix_z[slot], start.fix_t_ns[slot] = node.anchor, node.z, node.t_ns


@njit(nogil=True)
def _is_fresh(row: Row, node: Node, k: int) -> bool:
    return bool(row.start.fix_t_ns[k] > 0 and node.t_ns - row.start.fix_t_ns[k] < TOGETHER_NS)


@njit(nogil=True)
def _round(
    row: Row, node: Node, anchors: Anchors, linear: bool, x: float, y: float, ms: float
) -> tuple[float, float, float, float]:
    """Return a step (x, y) of least squares, the least eigenvalue of its matrix, and the squares that are left.

    linear: from the differences of the squares to their mean ms, with the mean (x, y) of the anchors.
    """
    xx = xy = yy = bx = by = misfit = 0.0
    for k in range(FIX_SLOTS):
        if not _is_fresh(row, node, k):
            continue
        a, settings, d = anchors[row.start.fix_anchor[k]], row.settings, _distance(row, anchors, k)
        if linear:
            ux, uy, w, e = a.x - x, a.y - y, 1.0, 0.5 * (a.x * a.x + a.y * a.y - d * d - ms)
        else:
            r, d = max(math.hypot(x - a.x, y - a.y), 1e-3), max(d, 0.1)
            tilt = (settings.height - a.z) / d * settings.height_std
            w = 1.0 / (settings.range_std**2 + settings.range_bias_std**2 + tilt * tilt)
            ux, uy, e = (x - a.x) / r, (y - a.y) / r, d - r
        xx, xy, yy = xx + w * ux * ux, xy + w * ux * uy, yy + w * uy * uy
        bx, by, misfit = bx + w * ux * e, by + w * uy * e, misfit + w * e * e
    det, least = xx * yy - xy * xy, 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy)
    return (yy * bx - xy * by) / det, (xx * by - xy * bx) / det, least, misfit


@njit(nogil=True)
def _solved(row: Row, node: Node, anchors: Anchors) -> tuple[float, float, float, float]:
    """Return (x, y, variance along the worst axis m^2, sum of squares of what is left in variances); inf: no place."""
    n = mx = my = ms = 0.0
    for k in range(FIX_SLOTS):
        if _is_fresh(row, node, k):
            a = anchors[row.start.fix_anchor[k]]
            n, mx, my = n + 1.0, mx + a.x, my + a.y
            ms += a.x * a.x + a.y * a.y - _distance(row, anchors, k) ** 2
    if n < LEAST:
        return 0.0, 0.0, math.inf, math.inf
    x, y, least, misfit = _round(row, node, anchors, True, mx / n, my / n, ms / n)
    if least < LEAST_SPREAD:
        return 0.0, 0.0, math.inf, math.inf
    for _ in range(ROUNDS):
        dx, dy, least, misfit = _round(row, node, anchors, False, x, y, 0.0)
        if least < 1e-9:
            return x, y, math.inf, math.inf
        x, y = x + dx, y + dy
    return x, y, 1.0 / least, misfit


@njit(nogil=True)
def _distance(row: Row, anchors: Anchors, k: int) -> float:
    """Return the horizontal distance, m, of the range in a slot."""
    return horizontal_distance(row, anchors[row.start.fix_anchor[k]], start_distance(row, row.start.fix_z[k]))

"""A bearing: the azimuth of the tag seen from an anchor."""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import TWO_PI, wrap
from dropanchor_service.estimation.fleet.belief.layout import (
    PHI,
    Anchors,
    Belief,
    Hypotheses,
    Hypothesis,
    R,
    Row,
    Scratch,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.measurement.scalar import gaussian, project, record_innovation, update_pda
from dropanchor_service.estimation.fleet.tuning import Tuning

BEARING_OUTLIER: Final = 0.05  # probability that a bearing says nothing


@njit(nogil=True)
def update_bearing(
    one: Hypothesis, scratch: Scratch, ox: float, oy: float, z: float, mirrored: float, variance: float
) -> float:
    """Update with the azimuth z, rad, of the tag seen from an anchor at (ox, oy) from the primary one.

    mirrored: the azimuth, rad, that looks the same to the anchor, NaN: none. The one nearer to the hypothesis counts.
    An outlier may have any azimuth. scratch.out receives (innovation, S, probability of an outlier). Return the log
    likelihood.
    """
    s, P, H, PH, out = one.mean, one.cov, scratch.H, scratch.PH, scratch.out
    H[:] = 0.0
    c, sn = math.cos(s[PHI]), math.sin(s[PHI])
    dx, dy = s[R] * c - ox, s[R] * sn - oy
    d2 = max(dx * dx + dy * dy, 1e-6)
    H[R] = (dx * sn - dy * c) / d2
    H[PHI] = s[R] * (dx * c + dy * sn) / d2
    there = math.atan2(dy, dx)
    e, other = wrap(z - there), wrap(mirrored - there)
    if abs(other) < abs(e):
        e = other
    S = project(P, H, PH) + variance
    inside = (1.0 - BEARING_OUTLIER) * gaussian(e, S)
    beta = inside / (inside + BEARING_OUTLIER / TWO_PI)
    update_pda(s, P, PH, S, e, beta)
    out[0] = e
    out[1] = S
    out[2] = 1.0 - beta
    return math.log(inside + BEARING_OUTLIER / TWO_PI)


@njit(nogil=True)
def update_with_bearing(
    work: Hypotheses, count: int, row: Row, node: Node, anchors: Anchors, t: Tuning, scratch: Scratch, belief: Belief
) -> None:
    """Update every hypothesis with the node's bearing."""
    anchor, primary, out = anchors[node.anchor], anchors[row.anchor], scratch.out
    ox, oy, variance = anchor.x - primary.x, anchor.y - primary.y, node.z_std**2
    mirrored = 2.0 * anchor.facing + math.pi - node.z if anchor.mirrors else math.nan
    best = best_of(work, count)
    for h in range(count):
        likelihood = update_bearing(work[h], scratch, ox, oy, node.z, mirrored, variance)
        work[h].log_weight += t.likelihood_power * likelihood
        if h == best:
            record_innovation(belief, out[0], out[1], out[2])

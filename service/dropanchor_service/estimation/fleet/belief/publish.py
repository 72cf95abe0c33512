"""What is published of a row: pose, covariance, weight of its mode, observability, state and reason."""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief import layout
from dropanchor_service.estimation.fleet.belief.summary import (
    add_reference,
    best_mode,
    forget_information,
    sigma_obs,
    spread_over_all,
    spread_over_classes,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import RANGE
from dropanchor_service.estimation.fleet.tuning import Tuning

UNRANGED = 3.0  # s without a range after which a place has to be resolved anew


@njit(nogil=True)
def publish(work: Any, count: int, row: Any, node: Any, anchors: Any, t: Tuning, belief: Any, scratch: Any) -> None:
    p_mode, relative, head = best_mode(work, count, row, scratch, t)
    mean, cov = scratch.mean, scratch.cov
    anchor = anchors[row.anchor]
    belief.x, belief.y = mean[0] + anchor.x, mean[1] + anchor.y
    belief.course, belief.speed, belief.yaw = mean[2], mean[3], mean[4]
    belief.yaw_rate = node.dyaw / node.dt_s if node.dt_s > 0.0 else 0.0
    r2 = mean[0] ** 2 + mean[1] ** 2
    blind = not math.isfinite(node.dv_var)
    forget_information(row.information, mean[2], node.dt_s, t.obs_q_blind if blind else t.obs_q, t)
    if node.kind == RANGE and r2 > 1e-6:
        c, s = mean[0] / math.sqrt(r2), mean[1] / math.sqrt(r2)
        weight = 1.0 / row.range_std**2
        row.information[0, 0] += c * c * weight
        row.information[0, 1] += c * s * weight
        row.information[1, 0] = row.information[0, 1]
        row.information[1, 1] += s * s * weight
    belief.sigma_obs = sigma_obs(row.information)
    _refer(row, mean, cov)
    _declare(row, node, p_mode, relative, math.sqrt(r2), t)
    _judge(row, relative, _sigma(cov), math.sqrt(r2), work[head].blocked == 1)
    if row.declared == 0 or p_mode < 0.9:
        spread_over_all(work, count, scratch)
        _refer(row, mean, cov)
    else:
        spread_over_classes(work, count, head, scratch, t.refuted)
        _refer(row, mean, cov)
    for i in range(3):
        for j in range(3):
            belief.cov[i, j] = cov[i, j]
    belief.p_mode = min(p_mode, 1.0)
    belief.sigma_pos = _sigma(cov)
    belief.hypotheses = count


@njit(nogil=True)
def _refer(row: Any, mean: Any, cov: Any) -> None:
    """A start that was found is known only as well as the heading reference."""
    if row.start_known == 0:
        reference = row.reference_std if row.referred == 1 else 1.8  # nothing known: sd of a uniform angle
        add_reference(cov, mean[0], mean[1], reference**2)


@njit(nogil=True)
def _sigma(cov: Any) -> float:
    return math.sqrt(max(cov[0, 0] + cov[1, 1], 0.0))


@njit(nogil=True)
def _declare(row: Any, node: Any, p_mode: float, relative: float, r: float, t: Tuning) -> None:
    """Whether one place has explained everything for long enough."""
    resolved = p_mode > t.resolved and relative < max(1.5, 0.05 * r)
    row.good_s = row.good_s + node.dt_s if resolved else 0.0
    row.bad_s = 0.0 if p_mode > 0.9 else row.bad_s + node.dt_s
    if row.good_s >= t.resolved_s or (row.start_known == 1 and row.again == 0 and row.declared == 0 and resolved):
        row.declared, row.coarse = 1, 0
    if row.bad_s > 1.0:
        row.declared = 0
    if row.since_range_s > UNRANGED:  # what follows must fit for a while before it is believed
        row.declared, row.again = 0, 1


@njit(nogil=True)
def _judge(row: Any, relative: float, sigma: float, r: float, blocked: bool) -> None:
    """State and reason."""
    if row.since_range_s > 30.0:
        row.state, row.reason = layout.LOST, 5
    elif row.unwatched_s > 10.0:
        row.state, row.reason = layout.LOST, 6
    elif row.unwatched_s > 0.5:
        row.state, row.reason = layout.DEGRADED, 6
    elif row.since_range_s > 1.5 and (row.declared == 1 or row.state == layout.COASTING):
        row.state, row.reason = layout.COASTING, 5
    elif row.declared == 0:
        row.state, row.reason = layout.AMBIGUOUS, 3
    elif sigma > max(3.0, 0.35 * r):
        # what is left of sigma without the rotation about the anchor tells which of the two it is
        row.state, row.reason = layout.AMBIGUOUS, 11 if relative < max(1.5, 0.05 * r) else 9
    elif row.misfit > 0.5 or blocked:
        row.state, row.reason = layout.DEGRADED, 7
    else:
        row.state, row.reason = layout.TRACKING, 4

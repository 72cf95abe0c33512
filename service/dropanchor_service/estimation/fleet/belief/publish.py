"""What is published of a row: pose, covariance, weight of its mode, observability, state, reason, and other modes."""

import math
from typing import Final

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.births.sight import MISFIT_LIMIT
from dropanchor_service.estimation.fleet.belief.layout import (
    Anchors,
    Belief,
    Floats,
    Hypotheses,
    Pool,
    Row,
    Scratch,
    Workspace,
)
from dropanchor_service.estimation.fleet.belief.mixture import normalise
from dropanchor_service.estimation.fleet.belief.parts import fill_parts
from dropanchor_service.estimation.fleet.belief.pool import load
from dropanchor_service.estimation.fleet.belief.rigidity import is_askew, slides
from dropanchor_service.estimation.fleet.belief.start import is_mirrored
from dropanchor_service.estimation.fleet.belief.states import (
    AMBIGUOUS,
    COASTING,
    DEGRADED,
    FRONT_OR_BACK,
    HEADING_UNSURE,
    IMU_MISSING,
    LOST,
    RANGES_MISSING,
    RANGES_REJECTED,
    RESOLVED,
    SEVERAL_MODES,
    TRACKING,
    UNCERTAIN,
)
from dropanchor_service.estimation.fleet.belief.summary import (
    best_mode,
    cluster,
    fill_positions,
    moments,
    spread_over_all,
    spread_over_families,
    widen_by_reference,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import RANGE, Node
from dropanchor_service.estimation.fleet.tuning import Tuning

DOMINANT: Final = 0.9  # weight of a mode above which the others hardly matter
DOMINANT_AGAIN: Final = 0.95  # the same, of a row that is ambiguous: it does not flicker
MIRRORED_S: Final = 8.0  # s for which one of two places ahead of an anchor and behind it has to hold that weight
UNRESOLVED_S: Final = 1.0  # s without a dominant mode after which one has to explain all ranges anew
RERESOLVE_AFTER: Final = 3.0  # s without a range after which one mode has to explain the ranges anew
COASTING_AFTER, RANGES_LOST_AFTER = 1.5, 30.0  # s without a range
IMU_DEGRADED_AFTER, IMU_LOST_AFTER = 0.5, 10.0  # s that no sensor observed
SMALL_M, SMALL_SHARE = 1.5, 0.1  # a mode is small below 1.5 m or 10 % of the distance
LIGHTEST: Final = 0.01  # weight of a mode that is listed
LARGE_M, LARGE_SHARE = 3.0, 0.35  # an ellipse is too large for use above 3 m or 35 % of the distance


@njit(nogil=True)
def publish(
    work: Hypotheses, count: int, row: Row, node: Node, anchors: Anchors, t: Tuning, belief: Belief, scratch: Scratch
) -> None:
    """Fill `belief` from the row's hypotheses, and update the row's publication."""
    p_mode, relative, head = best_mode(work, count, row, scratch, t)
    mean, cov = scratch.mean, scratch.cov
    anchor = anchors[row.anchor]
    belief.x, belief.y = mean[0] + anchor.x, mean[1] + anchor.y
    belief.course, belief.speed, belief.yaw = mean[2], mean[3], mean[4]
    belief.yaw_rate = node.dyaw / node.dt_s if node.dt_s > 0.0 else 0.0
    r = math.sqrt(mean[0] ** 2 + mean[1] ** 2)
    _update_information(row, node, mean, t)
    belief.sigma_obs = sigma_obs(row.publication.information)
    widen_by_reference(row, scratch)
    _update_resolved(row, node, p_mode, relative, r, t)
    undecided = row.walk.carried == 0 and (node.stepping == 1 or is_askew(row) or slides(row))
    _set_state(row, _has_rivals(row, p_mode), undecided, relative, _sigma_pos(cov), r, work[head].nlos == 1)
    if row.publication.resolved == 0 or p_mode < DOMINANT or row.walk.carried == 1:
        spread_over_all(work, count, scratch)
    else:
        spread_over_families(work, count, head, scratch, t.class_rejected_weight)
    widen_by_reference(row, scratch)
    spread = t.walk_spread if row.walk.carried == 1 else 1.0
    for i in range(3):
        for j in range(3):
            belief.cov[i, j] = spread * cov[i, j]
    belief.p_mode = min(p_mode, 1.0)
    belief.sigma_pos = math.sqrt(spread) * _sigma_pos(cov)
    fill_parts(row, anchor, scratch, belief)
    belief.hypotheses, belief.relative = count, 1 - row.heading.in_site_frame


@njit(nogil=True)
def _update_information(row: Row, node: Node, mean: Floats, t: Tuning) -> None:
    """Predict the information of recent ranges, and add that of this node's range."""
    information = row.publication.information
    no_acc = not math.isfinite(node.dv_var)
    predict_information(information, mean[2], node.dt_s, t.obs_q_no_acc if no_acc else t.obs_q, t)
    r2 = mean[0] ** 2 + mean[1] ** 2
    if node.kind == RANGE and r2 > 1e-6 and row.noise.white_var > 0.0:
        c, s = mean[0] / math.sqrt(r2), mean[1] / math.sqrt(r2)
        weight = row.settings.range_scale**2 / (row.noise.white_var * row.noise.factor)
        information[0, 0] += c * c * weight
        information[0, 1] += c * s * weight
        information[1, 0] = information[0, 1]
        information[1, 1] += s * s * weight


@njit(nogil=True)
def predict_information(J: Floats, course: float, dt: float, q: float, t: Tuning) -> None:
    """Predict the information J on (x, y, speed) over dt for p += v u dt.

    J <- e^(-dt/W) A^-T J A^-1, then the speed loses some of it: J -= J e_v e_v^T J q / (1 + q J_vv).
    """
    c, s = math.cos(course) * dt, math.sin(course) * dt
    for j in range(3):
        J[2, j] -= c * J[0, j] + s * J[1, j]
    for i in range(3):
        J[i, 2] -= c * J[i, 0] + s * J[i, 1]
    keep = math.exp(-dt / t.obs_window)
    loss = q * dt / (1.0 + q * dt * keep * J[2, 2])
    v0, v1, v2 = J[0, 2] * keep, J[1, 2] * keep, J[2, 2] * keep
    for i in range(3):
        for j in range(3):
            J[i, j] *= keep
    J[0, 0] -= v0 * v0 * loss
    J[0, 1] -= v0 * v1 * loss
    J[0, 2] -= v0 * v2 * loss
    J[1, 1] -= v1 * v1 * loss
    J[1, 2] -= v1 * v2 * loss
    J[2, 2] -= v2 * v2 * loss
    J[1, 0], J[2, 0], J[2, 1] = J[0, 1], J[0, 2], J[1, 2]


@njit(nogil=True)
def sigma_obs(J: Floats) -> float:
    """Return sqrt(lambda_max(J^-1)_xy), m: infinite where the ranges of the window do not fix a position."""
    if J[2, 2] <= 0.0:
        return math.inf
    a = J[0, 0] - J[0, 2] ** 2 / J[2, 2]  # Schur complement: information on (x, y) alone
    b = J[0, 1] - J[0, 2] * J[1, 2] / J[2, 2]
    d = J[1, 1] - J[1, 2] ** 2 / J[2, 2]
    smallest = 0.5 * (a + d) - math.sqrt(0.25 * (a - d) ** 2 + b * b)
    if smallest < 1e-6:
        return math.inf
    return 1.0 / math.sqrt(smallest)


@njit(nogil=True)
def _sigma_pos(cov: Floats) -> float:
    return math.sqrt(max(cov[0, 0] + cov[1, 1], 0.0))


@njit(nogil=True)
def _is_small(relative: float, r: float) -> bool:
    """Return whether a mode is small without a common rotation about the anchor. relative: its sigma, m."""
    return relative < max(SMALL_M, SMALL_SHARE * r)


@njit(nogil=True)
def _update_resolved(row: Row, node: Node, p_mode: float, relative: float, r: float, t: Tuning) -> None:
    """Set whether one mode has explained all ranges for long enough."""
    publication, start = row.publication, row.start
    resolved = p_mode > t.resolved_weight and _is_small(relative, r)
    publication.resolved_s = publication.resolved_s + node.dt_s if resolved else 0.0
    publication.unresolved_s = 0.0 if p_mode > DOMINANT else publication.unresolved_s + node.dt_s
    at_given_start = start.known == 1 and start.after_gap == 0 and publication.resolved == 0 and resolved
    mirrored = is_mirrored(row)
    if publication.resolved_s >= (MIRRORED_S if mirrored else t.resolved_s) or (at_given_start and not mirrored):
        publication.resolved, start.coarse, start.other_x = 1, 0, math.nan
    if publication.unresolved_s > UNRESOLVED_S:
        publication.resolved = 0
    if row.since_range_s > RERESOLVE_AFTER:
        publication.resolved, start.after_gap = 0, 1


@njit(nogil=True)
def _has_rivals(row: Row, p_mode: float) -> bool:
    """Return whether another mode than the published one may be the right one."""
    publication = row.publication
    doubted = publication.state == AMBIGUOUS and publication.reason in (SEVERAL_MODES, FRONT_OR_BACK)
    return bool(publication.resolved == 0 or p_mode < (DOMINANT_AGAIN if doubted else DOMINANT))


@njit(nogil=True)
def _set_state(row: Row, rivals: bool, undecided: bool, relative: float, sigma: float, r: float, nlos: bool) -> None:
    """Set state and reason of the publication. The first condition that holds decides."""
    publication, unobserved_s = row.publication, row.gap.unobserved_s
    if row.since_range_s > RANGES_LOST_AFTER:
        publication.state, publication.reason = LOST, RANGES_MISSING
    elif unobserved_s > IMU_LOST_AFTER:
        publication.state, publication.reason = LOST, IMU_MISSING
    elif unobserved_s > IMU_DEGRADED_AFTER:
        publication.state, publication.reason = DEGRADED, IMU_MISSING
    elif row.since_range_s > COASTING_AFTER and (publication.resolved == 1 or publication.state == COASTING):
        publication.state, publication.reason = COASTING, RANGES_MISSING
    elif rivals:
        publication.state, publication.reason = AMBIGUOUS, FRONT_OR_BACK if is_mirrored(row) else SEVERAL_MODES
    elif sigma > max(LARGE_M, LARGE_SHARE * r):
        # A mode that is small without the rotation about the anchor lacks only the heading.
        publication.state, publication.reason = AMBIGUOUS, HEADING_UNSURE if _is_small(relative, r) else UNCERTAIN
    elif undecided:  # whether it is carried, what its mounting angle is, or along which axis it moves
        publication.state, publication.reason = AMBIGUOUS, UNCERTAIN
    elif row.nlos.misfit > MISFIT_LIMIT or nlos:
        publication.state, publication.reason = DEGRADED, RANGES_REJECTED
    else:
        publication.state, publication.reason = TRACKING, RESOLVED


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

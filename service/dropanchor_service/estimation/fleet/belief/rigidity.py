"""Decide from the sideways increments of velocity whether the mount is rigid or loose.

A loose mount lets course minus body yaw wander (`slip_std`), which limits the position more than all else: nothing but
the ranges corrects a course that wanders. Most mounts are rigid, but nobody says so. A course that wanders shows as an
increment of velocity across the body, so the innovation of `lateral` has another variance in each of the two classes,

    S_loose = S_rigid + (slip_std^2 - RIGID_SLIP^2) 2 v^2 dt / tau,

and the log likelihood ratio of the innovations decides. It does not count where the two variances are alike, as at low
speed or on a rough ride: there, an error of the noise model would decide.

A mounting angle that is wrong by d moves a share tan d of each change of the speed to the sideways axis. The
correlation of the two tells such a tag from one that jolts.

A drone or a tag on a rope slides: it moves across its own axes. All hypotheses let a tag move along its course, so none
explains that; but ranges from one anchor and an untold mounting angle leave enough freedom for a wrong one to win. One
innovation tells little, because a jolt is as large. So it is summed over SLIDING_TAU, in which jolts cancel and sliding
does not. Of its standard deviation, that of the hypothesis and of the scale is the same from node to node and adds up;
the noise adds its square.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.layout import MOUNT, SLIP, Hypotheses, Hypothesis, Row, Scratch, V
from dropanchor_service.estimation.fleet.belief.mixture import best_of
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, Node
from dropanchor_service.estimation.fleet.measurement.lateral import (
    POWER,
    SHARE,
    is_lateral_known,
    lateral_residual,
    lateral_variance,
)
from dropanchor_service.estimation.fleet.measurement.scalar import project, update_pda
from dropanchor_service.estimation.fleet.tuning import Tuning

RIGID_SLIP: Final = 0.02  # rad, of a rigid mount
JOLTS_BELOW: Final = 0.35  # mean square of its normalised innovation below which the axis tells of the course
JOLTS_TAU: Final = 5.0  # s
JOLTS_CLIP: Final = 25.0  # limit of what one innovation counts
ASKEW_MISFIT: Final = 1.5  # mean square of it above which another mounting angle makes the tag ambiguous
ASKEW_SHARE: Final = 0.5  # share of it that another mounting angle explains at least, if it is that and no jolts
TELLING: Final = 2.0  # ratio of the two variances from which on an innovation tells between the classes
LOG_ODDS_LIMIT: Final = 10.0  # so that a mount that comes loose is noticed, and one skid is no loose mount
RIGID_ABOVE: Final = 3.0  # log odds at which a mount becomes rigid
LOOSE_BELOW: Final = 0.0  # and at which it is loose again
SLIDING_TAU: Final = 1.0  # s
REFUTED: Final = 2.0  # mean square of the normalised sum above which the tag slides; below 1.5 for 99 % of vehicles


@njit(nogil=True)
def _shows_other_angle(row: Row) -> bool:
    """Return whether another mounting angle would explain most of what the tag moves sideways. Jolts have no angle."""
    mount = row.mount
    return bool(mount.lateral_cross**2 > ASKEW_SHARE * mount.lateral_along * mount.lateral_misfit)


@njit(nogil=True)
def tells_course(row: Row) -> bool:
    """Return whether the sideways axis tells of the course and not of jolts: only then it may correct the belief."""
    return bool(row.mount.lateral_misfit < JOLTS_BELOW or _shows_other_angle(row))


@njit(nogil=True)
def is_askew(row: Row) -> bool:
    """Return whether the mounting angle of the belief is wrong, by what the sideways axis measures."""
    return bool(row.mount.lateral_misfit > ASKEW_MISFIT and _shows_other_angle(row))


@njit(nogil=True)
def slip_std_of(row: Row) -> float:
    """Return the standard deviation of course minus body yaw in use, rad: a given one, or that of the class."""
    given, configured = row.settings.slip_given == 1, float(row.settings.slip_std)
    return configured if given or row.mount.rigid == 0 else min(configured, RIGID_SLIP)


@njit(nogil=True)
def is_mount_untold(row: Row, t: Tuning) -> bool:
    """Return whether the mounting angle is one that nobody told."""
    return bool(row.settings.mount_angle_std > t.mount_untold_std)


@njit(nogil=True)
def weight_power(row: Row, rigid: bool, t: Tuning) -> float:
    """Return the power with which the sideways axis weighs the hypotheses: 0 unless it tells mounting angles apart."""
    return POWER if rigid and is_mount_untold(row, t) else 0.0


@njit(nogil=True)
def judge_mount(one: Hypothesis, scratch: Scratch, node: Node, row: Row) -> None:
    """Weigh what a node tells of the mount. one: the best hypothesis, before the node.

    A hand, or a cart on grass, moves sideways more than a rigid mount explains. While several hypotheses compete, large
    innovations tell of a wrong hypothesis and not of jolts. Small ones still tell of a rigid mount.
    """
    s, mount, settings = one.mean, row.mount, row.settings
    e = lateral_residual(s, node, scratch.H)
    S = project(one.cov, scratch.H, scratch.PH) + lateral_variance(s, node, row, RIGID_SLIP)
    if row.publication.resolved == 1:
        share = node.dt_s / (JOLTS_TAU + node.dt_s)
        weight = 1.0 / max(S, e * e / JOLTS_CLIP)
        mount.lateral_misfit += share * (weight * e * e - mount.lateral_misfit)
        mount.lateral_along += share * (weight * scratch.H[MOUNT] ** 2 - mount.lateral_along)
        mount.lateral_cross += share * (weight * scratch.H[MOUNT] * e - mount.lateral_cross)
    loose = S + (settings.slip_std**2 - RIGID_SLIP**2) * s[V] * s[V] * 2.0 * node.dt_s / settings.slip_tau
    if loose > TELLING * S:
        ratio = 0.5 * (math.log(loose / S) - e * e * (1.0 / S - 1.0 / loose))
        log_odds = mount.rigid_log_odds + POWER * max(ratio, -LOG_ODDS_LIMIT)
        mount.rigid_log_odds = min(max(log_odds, -LOG_ODDS_LIMIT), LOG_ODDS_LIMIT)


@njit(nogil=True)
def decide_mount(work: Hypotheses, count: int, row: Row, t: Tuning, scratch: Scratch) -> None:
    """Put the mount of a row in the class that its log odds tell, with hysteresis.

    None becomes rigid whose sideways axis tells of jolts: a device in a hand looked rigid between them.
    """
    mount = row.mount
    if mount.rigid == 0 and mount.rigid_log_odds > RIGID_ABOVE and tells_course(row):
        mount.rigid = 1
        if row.settings.slip_given == 0:
            for h in range(count):
                _rule_out_slip(work[h], is_mount_untold(row, t), scratch)
    elif mount.rigid == 1 and mount.rigid_log_odds < LOOSE_BELOW:
        mount.rigid = 0


@njit(nogil=True)
def follow_mount(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> bool:
    """Judge the mount by a node. Return whether its sideways increment may correct the hypotheses."""
    if not is_lateral_known(node):
        return False
    judge_mount(work[best_of(work, count)], scratch, node, row)
    decide_mount(work, count, row, t, scratch)
    return tells_course(row)


@njit(nogil=True)
def _rule_out_slip(one: Hypothesis, weigh: bool, scratch: Scratch) -> None:
    """Update a hypothesis with a slip of zero: what it has taken for slip is the mounting angle.

    weigh: it then also loses the weight that it owes to a slip.
    """
    scratch.H[:] = 0.0
    scratch.H[SLIP] = 1.0
    S = project(one.cov, scratch.H, scratch.PH) + RIGID_SLIP**2
    if weigh:
        one.log_weight -= 0.5 * (math.log(S) + one.mean[SLIP] ** 2 / S)
    update_pda(one.mean, one.cov, scratch.PH, S, -one.mean[SLIP], 1.0)


@njit(nogil=True)
def follow_sliding(one: Hypothesis, scratch: Scratch, node: Node, row: Row, t: Tuning) -> None:
    """Add what a node tells. one: the best hypothesis, before the node.

    Who tells the angle of a mount knows that the tag moves along its axis: then it never slides.
    """
    mount = row.mount
    if node.dt_s <= 0.0:
        return
    if not is_mount_untold(row, t):
        mount.sliding = 0.0
        return
    if node.rest != MOVING or not math.isfinite(node.dv_var) or node.carried == 1:
        mount.slid = mount.slid_std = mount.slid_var = 0.0
        return
    e = lateral_residual(one.mean, node, scratch.H)
    lasting_var = project(one.cov, scratch.H, scratch.PH)
    scale_var = SHARE**2 * (node.dv_forward**2 + node.dv_left**2)
    noise_var = lateral_variance(one.mean, node, row, row.settings.slip_std) - scale_var
    keep, share = math.exp(-node.dt_s / SLIDING_TAU), node.dt_s / (JOLTS_TAU + node.dt_s)
    mount.slid = keep * mount.slid + e
    mount.slid_std = keep * mount.slid_std + math.sqrt(max(lasting_var, 0.0) + scale_var)
    mount.slid_var = keep * keep * mount.slid_var + noise_var
    normalised = mount.slid * mount.slid / (mount.slid_std * mount.slid_std + mount.slid_var)
    mount.sliding += share * (min(normalised, JOLTS_CLIP) - mount.sliding)


@njit(nogil=True)
def slides(row: Row) -> bool:
    """Return whether a tag moves across its axes."""
    return bool(row.mount.sliding > REFUTED)

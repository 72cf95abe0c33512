"""What nobody told of a new tag: its mounting angle, whether its heading reference is wrong, and which of two places.

The mounting angle may be anything: cells cover all of it, with most of the weight straight ahead. A heading reference
with a slow error of its own explains the same ranges as one without for a long time. An anchor with two antennas
measures a start ahead of it, or at the mirror image behind it. All of it is guessed, and the ranges decide by the
weights of the hypotheses.
"""

import math

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.births.carrying import start_carried
from dropanchor_service.estimation.fleet.belief.births.first import collect_start
from dropanchor_service.estimation.fleet.belief.births.numbers import (
    MIRRORED_START,
    MOUNT_CELLS,
    OWN_ERROR_AGAIN,
)
from dropanchor_service.estimation.fleet.belief.births.numbers import OWN_ERROR as OWN_ERROR_BIRTH
from dropanchor_service.estimation.fleet.belief.heading_models import is_heading_std_given
from dropanchor_service.estimation.fleet.belief.heading_reference import add_reference_error
from dropanchor_service.estimation.fleet.belief.layout import (
    GYRO_BIAS,
    MAX_HYPOTHESES,
    MOUNT,
    OWN_ERROR,
    PHI,
    PLATFORM_MODEL,
    Anchors,
    Hypotheses,
    Hypothesis,
    R,
    Row,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis, keep_heaviest, normalise
from dropanchor_service.estimation.fleet.belief.start import (
    is_in_site_frame,
    is_mirrored,
    is_yaw_known,
    starts_at_place,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on


@njit(nogil=True)
def at_start(work: Hypotheses, row: Row, node: Node, anchors: Anchors, t: Tuning) -> int:
    """Make the first hypotheses once there is enough for them. Return their count."""
    count = collect_start(work, row, node, anchors, t)
    if count > 0:
        own_error = may_have_own_error(row, node, t)
        for h in range(count):
            if own_error and count < MAX_HYPOTHESES:
                _copy_own_error(work, h, count, row, t, not math.isfinite(row.start.heading))
                count += 1
        if _may_be_mounted_anyhow(row, node, t):
            count = _add_mounts(work, count, row, t)
        if node.carried == 1:
            count = start_carried(work, count, row, node, t)
        count = _start_at_both(work, count, row, t)
    return count


@njit(nogil=True)
def _may_be_mounted_anyhow(row: Row, node: Node, t: Tuning) -> bool:
    """Return whether the mounting angle of a new tag is a guess so wide that it needs cells.

    A wide guess is split only where it is heavy, so it never holds the few tags that are mounted quite differently.
    """
    wide = starts_at_place(row) and is_yaw_known(row, node) and row.settings.mount_angle_std > t.mount_cell
    return bool(wide and is_on(MOUNT_CELLS, t))


@njit(nogil=True)
def _add_mounts(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Copy each wide guess to the cells beside it, and make it that of the middle one. Return the count."""
    std, cells = row.settings.mount_angle_std, t.mount_cells
    total = 0.0
    for k in range(-cells, cells + 1):
        total += math.exp(-0.5 * (k * t.mount_cell / std) ** 2)
    for h in range(count):
        if count + 2 * cells > MAX_HYPOTHESES:
            continue
        work[h].cov[MOUNT, MOUNT] = (t.mount_cell / 2.0) ** 2
        for k in range(-cells, cells + 1):
            if k != 0:
                copy_hypothesis(work, h, count)
                _turn_mount(work[count], k, std, total, t)
                count += 1
        _turn_mount(work[h], 0, std, total, t)
    return count


@njit(nogil=True)
def _turn_mount(one: Hypothesis, k: int, std: float, total: float, t: Tuning) -> None:
    """Turn the mounting angle by k cells. Its prior has heavy tails: straight, normal with `std`, or anywhere."""
    straight = t.mount_straight if k == 0 else 0.0
    normal = (1.0 - t.mount_straight - t.mount_any) * math.exp(-0.5 * (k * t.mount_cell / std) ** 2) / total
    one.mean[MOUNT] = wrap(one.mean[MOUNT] + k * t.mount_cell)
    one.log_weight += math.log(straight + normal + t.mount_any / (2 * t.mount_cells + 1))


@njit(nogil=True)
def may_have_own_error(row: Row, node: Node, t: Tuning) -> bool:
    """Return whether the heading of a new tag may have an error of its own, which nobody told."""
    untold = starts_at_place(row) and is_in_site_frame(node.heading_kind) and not is_heading_std_given(row)
    return bool(untold and is_on(OWN_ERROR_BIRTH, t))


@njit(nogil=True)
def _copy_own_error(work: Hypotheses, source: int, target: int, row: Row, t: Tuning, yaw_from_reference: bool) -> None:
    """Copy `source` for a heading reference that has a slow error of its own. A platform's drifts as likely as not.

    yaw_from_reference: the yaw is known only from the reference, so it shares the error.
    """
    copy_hypothesis(work, source, target)
    work[target].heading_class = OWN_ERROR
    if row.heading.model == PLATFORM_MODEL:
        work[target].cov[GYRO_BIAS, GYRO_BIAS] = t.drift_std**2
    else:
        add_reference_error(work[target].cov, t.own_error_std, yaw_from_reference)
        work[target].log_weight += t.own_error_log_prior


@njit(nogil=True)
def try_own_error_again(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Give a resolved row the class of an error of its own again, if it has died out. Return the count."""
    of_class = 0
    for h in range(count):
        of_class += work[h].heading_class == OWN_ERROR
    known = row.publication.resolved == 0 or is_heading_std_given(row) or of_class > 0
    if known or count == MAX_HYPOTHESES or not is_on(OWN_ERROR_AGAIN, t):
        return count
    _copy_own_error(work, best_of(work, count), count, row, t, False)
    work[count].log_weight += t.own_error_again_log_prior
    return count + 1


@njit(nogil=True)
def _start_at_both(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Copy all hypotheses to the other place where a tag may start as well. Return their count."""
    start = row.start
    if not is_mirrored(row) or not is_on(MIRRORED_START, t):
        return count
    count = keep_heaviest(work, count, MAX_HYPOTHESES // 2)
    for h in range(count):
        copy_hypothesis(work, h, count + h)
        s, P = work[count + h].mean, work[count + h].cov
        x = s[R] * math.cos(s[PHI]) + start.other_x - start.x
        y = s[R] * math.sin(s[PHI]) + start.other_y - start.y
        r = max(math.hypot(x, y), 1e-3)
        P[PHI, PHI] *= (s[R] / r) ** 2
        s[R], s[PHI] = r, math.atan2(y, x)
    normalise(work, 2 * count)  # neither of the places is certain
    return 2 * count

"""The first guesses of a mounting angle that nobody told: straight ahead, and cells that also cover its tails."""

import math

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.births.numbers import ALIGNED, MOUNT_CELLS
from dropanchor_service.estimation.fleet.belief.layout import MAX_HYPOTHESES, MOUNT, Hypotheses, Hypothesis, Row
from dropanchor_service.estimation.fleet.belief.mixture import copy_hypothesis
from dropanchor_service.estimation.fleet.belief.rigidity import is_mount_untold
from dropanchor_service.estimation.fleet.belief.start import is_in_site_frame, is_yaw_known, starts_at_place
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on


@njit(nogil=True)
def may_be_aligned(row: Row, node: Node, t: Tuning) -> bool:
    """Return whether the body axis of a new tag may point along its course, as it mostly does."""
    untold = starts_at_place(row) and not is_in_site_frame(node.heading_kind) and is_mount_untold(row, t)
    return untold and is_on(ALIGNED, t)


@njit(nogil=True)
def copy_aligned(work: Hypotheses, source: int, target: int, t: Tuning) -> None:
    """Copy `source` for a body axis along the course."""
    copy_hypothesis(work, source, target)
    work[target].cov[MOUNT, MOUNT] = t.aligned_std**2
    work[target].aligned = 1
    work[target].log_weight += t.aligned_log_prior


@njit(nogil=True)
def may_be_mounted_anyhow(row: Row, node: Node, t: Tuning) -> bool:
    """Return whether the mounting angle of a new tag is a guess so wide that it needs cells.

    A wide guess is split only where it is heavy, so it never holds the few tags that are mounted quite differently.
    """
    wide = starts_at_place(row) and is_yaw_known(row, node) and row.settings.mount_angle_std > t.mount_cell
    return bool(wide and is_on(MOUNT_CELLS, t))


@njit(nogil=True)
def add_mounts(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Copy each wide guess to the cells beside it, and make it that of the middle one. Return the count."""
    std, cells = row.settings.mount_angle_std, t.mount_cells
    total = 0.0
    for k in range(-cells, cells + 1):
        total += math.exp(-0.5 * (k * t.mount_cell / std) ** 2)
    for h in range(count):
        if work[h].aligned == 1 or count + 2 * cells > MAX_HYPOTHESES:
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

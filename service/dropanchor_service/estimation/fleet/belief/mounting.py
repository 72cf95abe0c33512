"""The first guesses of a mounting angle that nobody told: straight ahead, and cells that also cover its tails."""

import math

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import MOUNT, Hypotheses, Hypothesis, Row
from dropanchor_service.estimation.fleet.belief.mixture import copy_hypothesis
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def is_mount_untold(row: Row, t: Tuning) -> bool:
    """Return whether the mounting angle is no better known than that of a body axis along the course."""
    return bool(row.settings.mount_angle_std > t.aligned_std)


@njit(nogil=True)
def add_aligned(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Copy all hypotheses for a body axis along the course, where it mostly is. Return the number of copies."""
    if not is_mount_untold(row, t):
        return 0
    for h in range(count):
        copy_hypothesis(work, h, count + h)
        work[count + h].cov[MOUNT, MOUNT] = t.aligned_std**2
        work[count + h].aligned = 1
        work[count + h].log_weight += t.aligned_log_prior
    return count


@njit(nogil=True)
def fan_mounts(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Replace each wide guess of the mounting angle by cells, each with a guess of its own. Return how many are new.

    A wide guess is split only where it is heavy, so it never holds the few tags that are mounted quite differently.
    """
    std, cells = row.settings.mount_angle_std, t.mount_cells
    if std <= t.mount_cell:
        return 0
    total = 0.0
    for k in range(-cells, cells + 1):
        total += math.exp(-0.5 * (k * t.mount_cell / std) ** 2)
    new = 0
    for h in range(count):
        if work[h].aligned == 0:
            work[h].cov[MOUNT, MOUNT] = (t.mount_cell / 2.0) ** 2
            for k in range(-cells, cells + 1):
                if k != 0:
                    copy_hypothesis(work, h, count + new)
                    _turn_mount(work[count + new], k, std, total, t)
                    new += 1
            _turn_mount(work[h], 0, std, total, t)
    return new


@njit(nogil=True)
def _turn_mount(one: Hypothesis, k: int, std: float, total: float, t: Tuning) -> None:
    """Turn the mounting angle by k cells. Its prior has heavy tails: straight, normal with `std`, or anywhere."""
    straight = t.mount_straight if k == 0 else 0.0
    normal = (1.0 - t.mount_straight - t.mount_any) * math.exp(-0.5 * (k * t.mount_cell / std) ** 2) / total
    one.mean[MOUNT] = wrap(one.mean[MOUNT] + k * t.mount_cell)
    one.log_weight += math.log(straight + normal + t.mount_any / (2 * t.mount_cells + 1))

"""Two classes of hypotheses in turn: is it the heading reference or the gyroscope that is wrong, or neither?

A heading reference with a slow error of its own explains the same ranges as one without for a long time. Both classes
are therefore kept, and the ranges decide between them by the weights of their hypotheses.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.heading_models import is_heading_std_given, reference_error
from dropanchor_service.estimation.fleet.belief.heading_reference import add_reference_error
from dropanchor_service.estimation.fleet.belief.layout import (
    DRIFT_MODEL,
    DRIFTING,
    EXACT,
    GYRO_BIAS,
    MAX_HYPOTHESES,
    OWN_ERROR,
    PLATFORM_MODEL,
    REFERENCE,
    Floats,
    Hypotheses,
    N,
    Row,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis
from dropanchor_service.estimation.fleet.belief.update import update_component
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning

EXACT_VAR: Final = 1e-8  # rad^2, of a reference error that is said to be zero


@njit(nogil=True)
def add_own_error_class(
    work: Hypotheses, source: int, target: int, row: Row, t: Tuning, yaw_from_reference: bool
) -> int:
    """Copy `source` to `target` for a heading reference that has a slow error of its own, or drifts.

    yaw_from_reference: the yaw is known only from the reference, so it shares the error. Return the number of copies:
    none where the operator gave the error of the heading.
    """
    if is_heading_std_given(row):
        return 0
    copy_hypothesis(work, source, target)
    work[target].heading_class = OWN_ERROR
    if row.heading.model == PLATFORM_MODEL:
        work[target].log_weight += t.drift_log_prior
        work[target].cov[GYRO_BIAS, GYRO_BIAS] = t.drift_std**2
    else:
        work[target].log_weight += t.own_error_log_prior
        add_reference_error(work[target].cov, t.own_error_std, yaw_from_reference)
    return 1


@njit(nogil=True)
def add_drift_class(work: Hypotheses, count: int, model: int, slow: float, t: Tuning) -> int:
    """Add hypotheses for a drifting gyroscope when heading and gyroscope drift apart. Return the count.

    Gyroscope and heading are equally suspect at first, and the ranges decide. Where the heading's error turns out not
    to be white, the hypotheses of a drifting gyroscope take that error and become exact ones.
    """
    old = count
    present = False
    for h in range(old):
        present |= work[h].heading_class == DRIFTING
    for h in range(old):
        if model == DRIFT_MODEL and not present and work[h].heading_class == EXACT and count < MAX_HYPOTHESES:
            copy_hypothesis(work, h, count)
            work[count].heading_class = DRIFTING
            work[count].log_weight += t.drift_again_log_prior
            count += 1
        elif model != DRIFT_MODEL and slow > 0.0 and work[h].heading_class == DRIFTING:
            work[h].heading_class = EXACT
            add_reference_error(work[h].cov, slow, False)
    return count


@njit(nogil=True)
def add_exact_class(work: Hypotheses, source: int, target: int, PH: Floats, t: Tuning) -> int:
    """Copy `source`, whose reference has an error of its own, for an exact reference. Return 1.

    The weight is the Savage-Dickey ratio: posterior over prior density of the reference error at zero.
    """
    copy_hypothesis(work, source, target)
    new = work[target]
    new.heading_class = EXACT
    error, variance = new.mean[REFERENCE], max(new.cov[REFERENCE, REFERENCE], 1e-9)
    log_ratio = 0.5 * math.log(t.own_error_std**2 / variance) - 0.5 * error * error / variance
    new.log_weight += log_ratio - t.own_error_log_prior
    update_component(new.mean, new.cov, PH, REFERENCE, 0.0, EXACT_VAR)
    for i in range(N):
        new.cov[REFERENCE, i] = new.cov[i, REFERENCE] = 0.0
    new.mean[REFERENCE] = 0.0
    return 1


@njit(nogil=True)
def keep_both_classes(work: Hypotheses, count: int, row: Row, node: Node, PH: Floats, t: Tuning) -> int:
    """Add the class that has died out, from the heaviest hypothesis of a resolved row. Return the count."""
    if row.publication.resolved == 0 or count >= MAX_HYPOTHESES:
        return count
    own_error = 0
    for h in range(count):
        own_error += work[h].heading_class == OWN_ERROR
    best = best_of(work, count)
    if own_error == 0:
        added = add_own_error_class(work, best, count, row, t, False)
        work[count].log_weight += t.own_error_again_log_prior
        return count + added
    _, slow, _ = reference_error(row, node.heading_var)
    if own_error == count and slow == 0.0:
        return count + add_exact_class(work, best, count, PH, t)
    return count

"""Classes of hypotheses: is the heading reference wrong?

A heading reference with a slow error of its own explains the same ranges as one without for a long time. Both classes
are therefore kept, and the ranges decide between them by the weights of their hypotheses.
"""

import math

from dropanchor_service.estimation.fleet.belief.births import numbers as births
from dropanchor_service.estimation.fleet.belief.heading_models import is_heading_std_given
from dropanchor_service.estimation.fleet.belief.heading_reference import add_reference_error
from dropanchor_service.estimation.fleet.belief.layout import (
    GYRO_BIAS,
    OWN_ERROR,
    PLATFORM_MODEL,
    Hypotheses,
    Row,
)
from dropanchor_service.estimation.fleet.belief.mixture import copy_hypothesis
from dropanchor_service.estimation.fleet.belief.start import is_in_site_frame, starts_at_place
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def is_due(kind: int, work: Hypotheses, count: int, row: Row, node: Node) -> bool:
    """Return whether row and node ask for another class."""
    if kind == births.OWN_ERROR:
        return may_have_own_error(row, node)
    return has_lost_own_error(work, count, row)


@njit(nogil=True)
def make(kind: int, work: Hypotheses, source: int, target: int, row: Row, t: Tuning) -> None:
    """Copy `source` to `target` for another class."""
    if kind == births.OWN_ERROR:
        copy_own_error(work, source, target, row, t, not math.isfinite(row.start.heading))
    else:
        copy_own_error(work, source, target, row, t, False)
        work[target].log_weight += own_error_log_prior(row, t)  # beside that of trying again


@njit(nogil=True)
def may_have_own_error(row: Row, node: Node) -> bool:
    """Return whether the heading of a new tag may have an error of its own, which nobody told."""
    return bool(starts_at_place(row) and is_in_site_frame(node.heading_kind) and not is_heading_std_given(row))


@njit(nogil=True)
def own_error_log_prior(row: Row, t: Tuning) -> float:
    """Return the log prior of a heading reference with an error of its own. A platform's drifts as likely as not."""
    return 0.0 if row.heading.model == PLATFORM_MODEL else t.own_error_log_prior


@njit(nogil=True)
def copy_own_error(work: Hypotheses, source: int, target: int, row: Row, t: Tuning, yaw_from_reference: bool) -> None:
    """Copy `source` for a heading reference that has a slow error of its own, or drifts.

    yaw_from_reference: the yaw is known only from the reference, so it shares the error.
    """
    copy_hypothesis(work, source, target)
    work[target].heading_class = OWN_ERROR
    if row.heading.model == PLATFORM_MODEL:
        work[target].cov[GYRO_BIAS, GYRO_BIAS] = t.drift_std**2
    else:
        add_reference_error(work[target].cov, t.own_error_std, yaw_from_reference)


@njit(nogil=True)
def has_lost_own_error(work: Hypotheses, count: int, row: Row) -> bool:
    """Return whether no hypothesis of a resolved row has a reference with an error of its own."""
    resolved, of_class = row.publication.resolved == 1 and not is_heading_std_given(row), 0
    for h in range(count):
        of_class += work[h].heading_class == OWN_ERROR
    return bool(resolved and of_class == 0)

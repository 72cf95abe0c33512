"""Classes of hypotheses: is the heading reference wrong?

A heading reference with a slow error of its own explains the same ranges as one without for a long time. Both classes
are therefore kept, and the ranges decide between them by the weights of their hypotheses.
"""

from dropanchor_service.estimation.fleet.belief.births.numbers import OWN_ERROR as OWN_ERROR_BIRTH
from dropanchor_service.estimation.fleet.belief.births.numbers import OWN_ERROR_AGAIN
from dropanchor_service.estimation.fleet.belief.heading_models import is_heading_std_given
from dropanchor_service.estimation.fleet.belief.heading_reference import add_reference_error
from dropanchor_service.estimation.fleet.belief.layout import (
    GYRO_BIAS,
    MAX_HYPOTHESES,
    OWN_ERROR,
    PLATFORM_MODEL,
    Hypotheses,
    Row,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis
from dropanchor_service.estimation.fleet.belief.start import is_in_site_frame, starts_at_place
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on


@njit(nogil=True)
def may_have_own_error(row: Row, node: Node, t: Tuning) -> bool:
    """Return whether the heading of a new tag may have an error of its own, which nobody told."""
    untold = starts_at_place(row) and is_in_site_frame(node.heading_kind) and not is_heading_std_given(row)
    return bool(untold and is_on(OWN_ERROR_BIRTH, t))


@njit(nogil=True)
def copy_own_error(work: Hypotheses, source: int, target: int, row: Row, t: Tuning, yaw_from_reference: bool) -> None:
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
    copy_own_error(work, best_of(work, count), count, row, t, False)
    work[count].log_weight += t.own_error_again_log_prior
    return count + 1

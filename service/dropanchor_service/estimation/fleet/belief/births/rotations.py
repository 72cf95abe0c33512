"""From a frame of the tag's own to the site frame: a second anchor or a bearing tells how the two are turned.

A track of ranges to one anchor, without north, is known up to a rotation about that anchor. It is copied with the
rotations of a whole circle, and the measurements of the other anchor decide between them.
"""

from typing import Final

from dropanchor_service.estimation.fleet.angles import TWO_PI
from dropanchor_service.estimation.fleet.belief.births.forgetting import MODE, forget
from dropanchor_service.estimation.fleet.belief.births.numbers import ROTATIONS
from dropanchor_service.estimation.fleet.belief.layout import PHI, YAW, Hypotheses, Row
from dropanchor_service.estimation.fleet.belief.mixture import copy_hypothesis, keep_heaviest
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import BEARING, RANGE, Node
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on

OTHER_ROTATIONS: Final = 35  # beside the one that a hypothesis has
CELL: Final = TWO_PI / (OTHER_ROTATIONS + 1)  # rad
SOURCES: Final = 4  # hypotheses that are turned, the heaviest


@njit(nogil=True)
def tells_rotation(row: Row, node: Node) -> bool:
    """Return whether the node's measurement depends on how the track is turned about its primary anchor."""
    return bool(node.kind == BEARING or (node.kind == RANGE and node.anchor != row.anchor))


@njit(nogil=True)
def place_in_site(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Copy the heaviest hypotheses with all rotations about the anchor, each as wide as a cell. Return the count.

    An ambiguous track is left as it is: each of its modes would need a circle of its own.
    """
    if row.publication.resolved == 0 or not is_on(ROTATIONS, t):
        return count
    count, spread = keep_heaviest(work, count, SOURCES), (CELL / 2.0) ** 2
    for h in range(count):
        P = work[h].cov
        P[PHI, PHI] += spread
        P[YAW, YAW] += spread
        P[PHI, YAW] += spread
        P[YAW, PHI] = P[PHI, YAW]
        for k in range(1, OTHER_ROTATIONS + 1):
            copy_hypothesis(work, h, count)
            work[count].mean[PHI] += k * CELL
            work[count].mean[YAW] += k * CELL
            count += 1
    row.heading.in_site_frame = 1
    forget(row, MODE)
    return count

"""From a frame of the tag's own to the site frame: a second anchor or a bearing tells how the two are turned.

A track of ranges to one anchor, without north, is known up to a rotation about that anchor. It is copied with the
rotations of a whole circle, and the measurements of the other anchor decide between them.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.layout import PHI, YAW, Hypotheses, Row
from dropanchor_service.estimation.fleet.belief.mixture import copy_hypothesis, keep_heaviest
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import BEARING, RANGE, Node

ROTATIONS: Final = 36
SOURCES: Final = 4  # hypotheses that are turned, the heaviest


@njit(nogil=True)
def tells_rotation(row: Row, node: Node) -> bool:
    """Return whether the node's measurement depends on how the track is turned about its primary anchor."""
    return bool(node.kind == BEARING or (node.kind == RANGE and node.anchor != row.anchor))


@njit(nogil=True)
def place_in_site(work: Hypotheses, count: int, row: Row) -> int:
    """Copy the heaviest hypotheses with all rotations about the anchor. Return the count.

    An ambiguous track is left as it is: each of its modes would need a circle of its own.
    """
    if row.publication.resolved == 0:
        return count
    sources = keep_heaviest(work, count, SOURCES)
    cell = 2.0 * math.pi / ROTATIONS
    for h in range(sources):
        P, spread = work[h].cov, (cell / 2.0) ** 2
        P[PHI, PHI] += spread
        P[YAW, YAW] += spread
        P[PHI, YAW] += spread
        P[YAW, PHI] = P[PHI, YAW]
        for k in range(1, ROTATIONS):
            target = sources + h * (ROTATIONS - 1) + k - 1
            copy_hypothesis(work, h, target)
            work[target].mean[PHI] += k * cell
            work[target].mean[YAW] += k * cell
    row.heading.in_site_frame = 1
    row.publication.resolved = 0
    row.publication.resolved_s = 0.0
    return sources * ROTATIONS

"""The height in a range: what an uncertain height changes of its mean and of its variance.

Of a height z above the anchor with the variance P, independent of the horizontal distance r,

    E (r^2 + z^2) = r^2 + dz^2 + P        var sqrt(r^2 + z^2) = (dz^2 P + P^2 / 2) / distance^2

A tag is no higher than its range: P counts as that of a uniform height within it at most. The error of a height lasts.
What exceeds the bias that each range may have anyway is therefore counted once in `range_bias_tau`.
"""

import math
from typing import Any, Final

from dropanchor_service.estimation.fleet.belief.layout import Belief, Row
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.height import TOLD
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning

COVERED_STD: Final = 0.15  # m, of an error of a range that lasts: the filter allows for it
SHORTEST_S: Final = 0.02  # s between two ranges


@njit(nogil=True)
def take_height(row: Row, node: Node, belief: Belief) -> None:
    """Take the node's height into the row, unless it is as told, and into what is published."""
    settings = row.settings
    if node.height_std > 0.0:
        settings.height, settings.height_std = node.height, node.height_std
        settings.height_source = node.height_source
    belief.z, belief.z_std = settings.height, settings.height_std


@njit(nogil=True)
def offset_of(settings: Any, dz: float, distance: float) -> float:
    """Return the root of the mean square height, m, above an anchor at this distance: |dz| if the height is told."""
    if settings.height_source == TOLD:
        return dz
    return math.sqrt(dz * dz + _variance(settings, distance))


@njit(nogil=True)
def height_variance(row: Row, dz: float, distance: float, t: Tuning) -> float:
    """Return what a height that nobody told adds to the variance of a range, m^2, beside its first-order term."""
    settings = row.settings
    P = _variance(settings, distance)
    second = P * P / (2.0 * distance * distance)
    all_of_it = settings.range_scale**2 * (dz * dz * P / (distance * distance) + second)
    lasting = max(all_of_it - COVERED_STD**2, 0.0) * t.range_bias_tau / max(row.since_range_s, SHORTEST_S)
    return float(settings.range_scale**2 * second + lasting)


@njit(nogil=True)
def _variance(settings: Any, distance: float) -> float:
    """Return the variance of the height, m^2, of a tag at this distance of the anchor."""
    return float(min(settings.height_std**2, max(distance, 0.1) ** 2 / 3.0))

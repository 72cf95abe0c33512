"""A tag beside the point that follows the course: on a mast, or held out in front.

The pivot (a rear axle, a person's feet) moves along the course. The tag is a lever (x, y) away, in the body frame, and
swings about the pivot when that turns. With w the rate and R(a) a turn by a, over a node:

    swing = (R(dyaw) - I) lever,   dv of the pivot = dv of the tag - (R(dyaw) w x lever at the end - w x lever before).

Rates are means over a node. The state is the place of the tag and the speed of the pivot.
"""

import math
from typing import Any

from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node


@njit(nogil=True)
def apply_lever(row: Any, node: Node) -> None:
    """Fill the node's swing, and turn its dv into that of the pivot."""
    x, y = row.settings.lever_x, row.settings.lever_y
    if x == 0.0 and y == 0.0:
        return
    c, s = math.cos(node.dyaw), math.sin(node.dyaw)
    node.swing_forward = (c - 1.0) * x - s * y
    node.swing_left = s * x + (c - 1.0) * y
    before = row.lever_rate
    if node.dt_s > 0.0:
        row.lever_rate = node.dyaw / node.dt_s
    after = row.lever_rate
    node.dv_forward -= -after * (c * y + s * x) + before * y
    node.dv_left -= after * (c * x - s * y) - before * x

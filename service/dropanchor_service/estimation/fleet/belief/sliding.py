"""Notice a tag that slides: it moves across its own axes, as a drone or a tag on a rope does.

All hypotheses let a tag move along its course, which turns with its body. What one that slides does is explained by
none; but ranges from one anchor and an untold mounting angle leave enough freedom for a wrong one to win.

The innovation e of the increment of velocity across the course (`measurement/lateral.py`) tells. One increment tells
little, because a jolt is as large. So e is summed over TAU, in which jolts cancel and sliding does not. Of its standard
deviation, that of the hypothesis and of the scale is the same from node to node and adds up; the noise adds its square.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.layout import Hypothesis, Row, Scratch
from dropanchor_service.estimation.fleet.belief.rigidity import JOLTS_CLIP, JOLTS_TAU, is_mount_untold
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, Node
from dropanchor_service.estimation.fleet.measurement.lateral import SHARE, lateral_residual, lateral_variance
from dropanchor_service.estimation.fleet.measurement.scalar import project
from dropanchor_service.estimation.fleet.tuning import Tuning

TAU: Final = 1.0  # s
REFUTED: Final = 2.0  # mean square of the normalised sum above which the tag slides; below 1.5 for 99 % of vehicles


@njit(nogil=True)
def follow_sliding(one: Hypothesis, scratch: Scratch, node: Node, row: Row, t: Tuning) -> None:
    """Add what a node tells. one: the best hypothesis, before the node.

    Who tells the angle of a mount knows that the tag moves along its axis: then it never slides.
    """
    mount = row.mount
    if node.dt_s <= 0.0:
        return
    if not is_mount_untold(row, t):
        mount.sliding = 0.0
        return
    if node.rest != MOVING or not math.isfinite(node.dv_var) or node.carried == 1:
        mount.slid = mount.slid_std = mount.slid_var = 0.0
        return
    e = lateral_residual(one.mean, node, scratch.H)
    lasting_var = project(one.cov, scratch.H, scratch.PH)
    scale_var = SHARE**2 * (node.dv_forward**2 + node.dv_left**2)
    noise_var = lateral_variance(one.mean, node, row, row.settings.slip_std) - scale_var
    keep, share = math.exp(-node.dt_s / TAU), node.dt_s / (JOLTS_TAU + node.dt_s)
    mount.slid = keep * mount.slid + e
    mount.slid_std = keep * mount.slid_std + math.sqrt(max(lasting_var, 0.0) + scale_var)
    mount.slid_var = keep * keep * mount.slid_var + noise_var
    normalised = mount.slid * mount.slid / (mount.slid_std * mount.slid_std + mount.slid_var)
    mount.sliding += share * (min(normalised, JOLTS_CLIP) - mount.sliding)


@njit(nogil=True)
def slides(row: Row) -> bool:
    """Return whether a tag moves across its axes."""
    return bool(row.mount.sliding > REFUTED)

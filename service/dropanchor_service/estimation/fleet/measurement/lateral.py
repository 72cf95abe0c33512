"""Update a hypothesis with the sideways acceleration, which tells the mounting angle and the speed.

What travels along its course turns its velocity by as much as its course turns. With w = dyaw - b_g dt,
c = mount + slip + w/2, the increments f = dv_forward cos c + dv_left sin c - b_a dt along the course in the middle of
the node and l = dv_left cos c - dv_forward sin c across it, and the mean speed u = v' - f/2,

    l = 2 u sin(w/2) + b_l dt.

A wrong mounting angle makes a ramp of the speed leak into l, which the ranges see only through a product of speed and
time. A turn compares the speed with the centripetal acceleration.

On a rigid mount that nobody told, l also weighs the hypotheses: they have different mounting angles, and l tells these
apart before the ranges do. Where the angle is told, they differ by what the biases hide, and l weighs none. Its noise
grows with the speed, by a slip that most mounts do not have. So the weight has the variance S over that noise: S alone
would make a hypothesis the likelier, the slower it is, and with every node.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.layout import (
    ACC_BIAS,
    GYRO_BIAS,
    LEFT_BIAS,
    MOUNT,
    SLIP,
    Floats,
    Hypothesis,
    Row,
    Scratch,
    V,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, Node
from dropanchor_service.estimation.fleet.frontend.preintegration import ONE_WAY
from dropanchor_service.estimation.fleet.measurement.scalar import project, update_pda

BOUND: Final = 3.0  # standard deviations beyond which a sideways increment is a skid or a bump and counts less
SMOOTH: Final = 0.015  # (m/s)^2/s, roughness of dv above which the sideways axis tells more of jolts than of the course
MIN_VAR: Final = 1e-6  # (m/s)^2
SHARE: Final = 0.05  # of the increment, error of scale and timing: the body turns while a sharp turn is integrated
POWER: Final = 0.3  # of each likelihood of l: the errors of consecutive nodes are alike


@njit(nogil=True)
def increments(node: Node, c: float) -> tuple[float, float]:
    """Return the increments of velocity along and across a course that is c from the body axis, m/s."""
    cc, sc = math.cos(c), math.sin(c)
    return node.dv_forward * cc + node.dv_left * sc, node.dv_left * cc - node.dv_forward * sc


@njit(nogil=True)
def lateral_residual(s: Floats, node: Node, H: Floats) -> float:
    """Return 2 u sin(w/2) + b_l dt - l, m/s, of a state at the end of the node, and fill H with its derivative."""
    dt = node.dt_s
    w = node.dyaw - s[GYRO_BIAS] * dt
    half = math.sin(w / 2)
    along, across = increments(node, s[MOUNT] + s[SLIP] + w / 2)
    u = s[V] - (along - s[ACC_BIAS] * dt) / 2
    H[:] = 0.0
    H[V] = 2.0 * half
    H[MOUNT] = H[SLIP] = along - across * half
    H[GYRO_BIAS] = -dt * (u * math.cos(w / 2) + H[MOUNT] / 2)
    H[ACC_BIAS] = dt * half
    H[LEFT_BIAS] = dt
    return float(2.0 * u * half + s[LEFT_BIAS] * dt - across)


@njit(nogil=True)
def is_lateral_known(node: Node) -> bool:
    """Return whether the node has a sideways increment of velocity of a tag that moves smoothly."""
    return bool(node.rest == MOVING and node.dt_s > 0.0 and sideways_var(node) < SMOOTH * node.dt_s)


@njit(nogil=True)
def sideways_var(node: Node) -> float:
    """Return the variance of the increment across the course from the roughness of the ride, (m/s)^2.

    What shakes along almost one direction only is a vehicle that speeds up and brakes, and tells where its course is.
    """
    across = node.dv_var - node.motion_var
    return float(across if across < (1.0 - ONE_WAY) * node.dv_var else node.dv_var)


@njit(nogil=True)
def lateral_variance(s: Floats, node: Node, row: Row, slip_std: float) -> float:
    """Return the variance of that increment, (m/s)^2. A change of the slip is an increment of velocity, too."""
    shared_var = SHARE**2 * (node.dv_forward**2 + node.dv_left**2)
    slip_var = slip_std**2 * 2.0 * node.dt_s / row.settings.slip_tau
    return float(sideways_var(node) + s[V] * s[V] * (node.dyaw_var + slip_var) + shared_var + MIN_VAR)


@njit(nogil=True)
def update_lateral(one: Hypothesis, scratch: Scratch, node: Node, row: Row, slip_std: float, power: float) -> None:
    """Update one hypothesis, predicted over the node, with the sideways increment of its velocity.

    slip_std: rad, of the mount in use. power: of the likelihood in the weight, 0 to 1. An increment beyond `BOUND`
    counts as one of that size.
    """
    s = one.mean
    e = -lateral_residual(s, node, scratch.H)
    noise = lateral_variance(s, node, row, slip_std)
    S = max(project(one.cov, scratch.H, scratch.PH) + noise, e * e / BOUND**2)
    if power > 0.0:
        one.log_weight -= 0.5 * power * (math.log(S / noise) + e * e / S)
    update_pda(s, one.cov, scratch.PH, S, e, 1.0)

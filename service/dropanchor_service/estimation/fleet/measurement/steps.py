"""The steps of a person: their speed and their direction, and a person who stands.

step speed = v e^k        gait angle = mount + slip + b
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import TWO_PI, wrap
from dropanchor_service.estimation.fleet.belief.layout import (
    GAIT_OFFSET,
    MOUNT,
    SLIP,
    STEP_SCALE,
    Floats,
    Hypothesis,
    Scratch,
    V,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.measurement.scalar import gaussian, project, update_component, update_pda
from dropanchor_service.estimation.fleet.tuning import Tuning

LEAST_SCALE_SPEED: Final = 0.1  # m/s
FLIPPED, ANYWHERE = 0.05, 0.05  # shares of gait angles that point backwards, or anywhere


@njit(nogil=True)
def predict_step_speed(s: Floats, H: Floats) -> float:
    """Return v e^k, m/s, and fill H with its derivative."""
    scale = math.exp(s[STEP_SCALE])
    H[:] = 0.0
    H[V] = scale
    H[STEP_SCALE] = scale * max(s[V], LEAST_SCALE_SPEED)
    return float(s[V] * scale)


@njit(nogil=True)
def step_speed_variance(z: float, t: Tuning) -> float:
    """Return the variance, (m/s)^2, of a speed that steps give."""
    return float(max(t.step_speed_share * z, t.step_speed_std) ** 2)


@njit(nogil=True)
def update_step_speed(one: Hypothesis, scratch: Scratch, z: float, t: Tuning) -> None:
    """Update with the speed of the steps, m/s: z = v e^k."""
    e = z - predict_step_speed(one.mean, scratch.H)
    S = project(one.cov, scratch.H, scratch.PH) + step_speed_variance(z, t)
    update_pda(one.mean, one.cov, scratch.PH, S, e, 1.0)


@njit(nogil=True)
def update_gait_angle(one: Hypothesis, scratch: Scratch, z: float, t: Tuning) -> float:
    """Update with the direction of the steps, rad: z = mount + slip + b. Return the log likelihood."""
    s, H = one.mean, scratch.H
    e = wrap(z - s[MOUNT] - s[SLIP] - s[GAIT_OFFSET])
    H[:] = 0.0
    H[MOUNT] = H[SLIP] = H[GAIT_OFFSET] = 1.0
    S = project(one.cov, H, scratch.PH) + t.gait_angle_std**2
    inside = (1.0 - FLIPPED - ANYWHERE) * gaussian(e, S)
    outside = FLIPPED * gaussian(wrap(e + math.pi), S) + ANYWHERE / TWO_PI
    update_pda(s, one.cov, scratch.PH, S, e, inside / (inside + outside))
    return math.log(inside + outside)


@njit(nogil=True)
def update_steps(one: Hypothesis, scratch: Scratch, node: Node, t: Tuning) -> None:
    """Update one hypothesis of a carried tag with what the node says of steps."""
    if node.step_speed > 0.0:
        update_step_speed(one, scratch, node.step_speed, t)
    if node.gait_coherence > 0.0:
        one.log_weight += update_gait_angle(one, scratch, node.gait_angle, t)
    if node.stands == 1:
        update_component(one.mean, one.cov, scratch.PH, V, 0.0, t.stand_std**2)

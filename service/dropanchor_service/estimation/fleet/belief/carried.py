"""A tag that a person carries: how its state wanders.

The course is yaw + mount + slip, where the mounting angle may be anything and slip is the sway of the hand. The speed
is a random walk that steps measure (`measurement/steps.py`). Accelerations are not used, so the scale and the offset of
the steps stand in the state where the accelerometer's biases are otherwise.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.layout import (
    GAIT_OFFSET,
    MOUNT,
    SLIP,
    STEP_SCALE,
    Floats,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning

RING_MOUNT_STD: Final = 1.2  # rad, of the mounting angle of somebody's device, as one Gaussian


@njit(nogil=True)
def fill_carried_noise(decay: Floats, growth: Floats, dt: float, row: Row, t: Tuning) -> None:
    """Fill what differs from a vehicle: speed, mounting angle, sway, and the constants of the steps."""
    growth[V] = t.q_walk_speed * dt
    growth[MOUNT] = t.q_grip * dt
    decay[SLIP] = math.exp(-dt / t.sway_tau)
    std = row.settings.slip_std if row.settings.slip_given == 1 else t.sway_std
    growth[SLIP] = std**2 * (1.0 - decay[SLIP] ** 2)
    decay[GAIT_OFFSET] = decay[STEP_SCALE] = 1.0
    growth[GAIT_OFFSET], growth[STEP_SCALE] = 0.0, t.q_step_scale * dt

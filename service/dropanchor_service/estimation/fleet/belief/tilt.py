"""Predict the error of the tilt over a node: the biases of a rigid accelerometer are mostly that.

The tilt filter takes a share k of each acceleration for gravity (`correct_tilt`). What it takes in an arc is known: the
acceleration across the course is v w / dt. The error (b_a, b_l) keeps its direction in the room, so a turn by w of the
body moves it from one axis to the other:

    b_l <- b_l - k v w / dt,   (b_a, b_l) <- rotation by -w of (b_a, b_l).

Without this an arc of seconds ends up as a bias of the forward axis, where no range corrects it while the tag travels
across the line of sight. What a ramp of the speed takes is left to the noise of the biases.
"""

import math

from dropanchor_service.estimation.fleet.belief.layout import ACC_BIAS, GYRO_BIAS, LEFT_BIAS, Floats, N, V
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, Node


@njit(nogil=True)
def bends_tilt(node: Node) -> bool:
    """Return whether the accelerometer of a ground vehicle was used over the node while it moved."""
    return bool(node.rest == MOVING and node.carried == 0 and node.dt_s > 0.0 and math.isfinite(node.dv_var))


@njit(nogil=True)
def predict_tilt(s: Floats, P: Floats, node: Node) -> None:
    """Predict the biases of a rigid mount, and their covariance, in a state that was predicted over the node."""
    w = node.dyaw - s[GYRO_BIAS] * node.dt_s
    share = node.tilt_gain / node.dt_s
    by_speed, by_gyro = -share * w, node.tilt_gain * s[V]
    c, n = math.cos(w), math.sin(w)
    a, b = s[ACC_BIAS], s[LEFT_BIAS] - share * w * s[V]
    s[ACC_BIAS], s[LEFT_BIAS] = c * a + n * b, c * b - n * a
    for i in range(N):
        a, b = P[i, ACC_BIAS], P[i, LEFT_BIAS] + by_speed * P[i, V] + by_gyro * P[i, GYRO_BIAS]
        P[i, ACC_BIAS], P[i, LEFT_BIAS] = c * a + n * b, c * b - n * a
    for i in range(N):
        a, b = P[ACC_BIAS, i], P[LEFT_BIAS, i] + by_speed * P[V, i] + by_gyro * P[GYRO_BIAS, i]
        P[ACC_BIAS, i], P[LEFT_BIAS, i] = c * a + n * b, c * b - n * a

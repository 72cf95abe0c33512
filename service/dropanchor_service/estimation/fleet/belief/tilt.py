"""Predict the error of the tilt over a node: the biases of a rigid accelerometer are mostly that.

The tilt filter takes a share k of each acceleration for gravity (`correct_tilt`). What it takes is known: with f, the
change of the speed, the acceleration is f / dt along the course and v w / dt across it. The error (b_a, b_l) keeps its
direction in the room, so a turn by w of the body moves it from one axis to the other:

    b_a <- b_a - k f / dt,   b_l <- b_l - k v w / dt,   (b_a, b_l) <- rotation by -w of (b_a, b_l).

f is the measured change less b_a dt. For that b_a, k counts as dt / TAU at most, about what b_a decays by
(`fill_noise`): while the tilt settles, k is larger, and an error of b_a would grow.

Without this an arc of seconds ends up as a bias of the forward axis, where no range corrects it while the tag travels
across the line of sight, and a tag that brakes hard backs off with a bias of 0.4 m/s^2.

On a mount that may be loose the direction of that error is not known, and its size is: the arc adds to the variance of
both biases, as noise of the size k v w / dt that keeps its direction for some seconds.

A gyroscope that no rest has taught has a bias, and under it the tilt filter settles at TAU times the bias. The
front-end knows the variance of that tilt. It goes to both biases within TILTING_S on a smooth ride. On a rough one the
noise of the accelerations already holds what the tilt does in that time.
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
    N,
    V,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.attitude import TAU
from dropanchor_service.estimation.fleet.frontend.node import MOVING, Node
from dropanchor_service.estimation.fleet.frontend.preintegration import G0
from dropanchor_service.estimation.fleet.measurement.lateral import increments, is_lateral_known
from dropanchor_service.estimation.fleet.tuning import Tuning

TILTING_S: Final = 25.0  # s, in which the biases gain the whole tilt of an unknown gyroscope
ROUGH: Final = 2e-3  # (m/s)^2/s, roughness from which on they gain nothing of it


@njit(nogil=True)
def tilting_growth(node: Node, rough: float) -> float:
    """Return what the variance of both biases gains over the node by a gyroscope whose bias is not known, (m/s^2)^2.

    rough is what the noise of the accelerations adds to the speed, (m/s)^2/s.
    """
    smooth = max(0.0, 1.0 - rough / ROUGH)
    return float(smooth * G0 * G0 * node.gyro_tilt_var * -math.expm1(-2.0 * node.dt_s / TILTING_S))


@njit(nogil=True)
def bends_tilt(node: Node, rigid: bool) -> bool:
    """Return whether the accelerometer of a ground vehicle was used over the node while it moved.

    On a mount that may be loose a rough ride tells no arc.
    """
    moves = node.rest == MOVING and node.carried == 0 and node.dt_s > 0.0 and math.isfinite(node.dv_var)
    return bool(moves and (rigid or is_lateral_known(node)))


@njit(nogil=True, borrows=True)
def follow_tilt(s: Floats, P: Floats, node: Node, rigid: bool, t: Tuning) -> None:
    """Take what the tilt filter made of the node into a state that was predicted over it."""
    if rigid:
        predict_tilt(s, P, node)
    else:
        widen_tilt(s, P, node, t)


@njit(nogil=True)
def predict_tilt(s: Floats, P: Floats, node: Node) -> None:
    """Predict the biases of a rigid mount, and their covariance, in a state that was predicted over the node."""
    w, share = node.dyaw - s[GYRO_BIAS] * node.dt_s, node.tilt_gain / node.dt_s
    along, _ = increments(node, s[MOUNT] + s[SLIP] + w / 2)
    c, n = math.cos(w), math.sin(w)
    a = (1.0 + min(node.tilt_gain, node.dt_s / TAU)) * s[ACC_BIAS] - share * along
    b = s[LEFT_BIAS] - share * w * s[V]
    s[ACC_BIAS], s[LEFT_BIAS] = c * a + n * b, c * b - n * a
    turn_columns(P, s, node)
    turn_columns(P.T, s, node)


@njit(nogil=True)
def turn_columns(C: Floats, s: Floats, node: Node) -> None:
    """Do to the columns of C, covariances with the predicted state s, what `predict_tilt` does to that state."""
    w, share = node.dyaw - s[GYRO_BIAS] * node.dt_s, node.tilt_gain / node.dt_s
    _, across = increments(node, s[MOUNT] + s[SLIP] + w / 2)
    c, n = math.cos(w), math.sin(w)
    by_bias, by_course = 1.0 + min(node.tilt_gain, node.dt_s / TAU), -share * across
    by_speed, by_gyro = -share * w, node.tilt_gain * s[V]
    for i in range(N):
        turned = C[i, MOUNT] + C[i, SLIP] - C[i, GYRO_BIAS] * node.dt_s / 2
        a = by_bias * C[i, ACC_BIAS] + by_course * turned
        b = C[i, LEFT_BIAS] + by_speed * C[i, V] + by_gyro * C[i, GYRO_BIAS]
        C[i, ACC_BIAS], C[i, LEFT_BIAS] = c * a + n * b, c * b - n * a


@njit(nogil=True)
def widen_tilt(s: Floats, P: Floats, node: Node, t: Tuning) -> None:
    """Add to the covariance of a state, predicted over the node, what an arc may bend on a mount that may be loose."""
    w = node.dyaw - s[GYRO_BIAS] * node.dt_s
    bent = node.tilt_gain * s[V] * w / node.dt_s
    variance = bent * bent * 2.0 * t.bending_s / node.dt_s
    P[ACC_BIAS, ACC_BIAS] += variance
    P[LEFT_BIAS, LEFT_BIAS] += variance

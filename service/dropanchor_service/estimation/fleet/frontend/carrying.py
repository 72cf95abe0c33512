"""What a tag tells of the person who carries it: whether one does, and what the belief needs then.

The yaw of a carried tag is the rotation of the device about the vertical. The azimuth of body x has no meaning where x
is upright. With a reference direction u0 of up in the body and m the shortest rotation from z to u0,

    yaw = 2 atan2(q'_z, q'_w) + shift,   q' = q m

has a rate of w . up where up is u0, and no singularity within a quarter turn of it. For u0 = z it is the azimuth of x.
"""

import math
from typing import Any, Final, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array, Motion
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.attitude import TAU, Attitude, up_in_body
from dropanchor_service.estimation.fleet.frontend.gait import (
    FULL_SWING,
    GAIT,
    MAX_INTERVAL,
    MM_PER_M,
    STRIDE,
    WALK,
    add_step_sample,
    add_stride_sample,
    start_gait,
    step_speed,
    stride_direction,
)
from dropanchor_service.estimation.fleet.frontend.node import Node

CARRYING: Final = np.dtype(
    [
        ("gait", GAIT),
        ("stride", STRIDE),
        ("motion", "u1"),  # the setting
        ("carried", "u1"),  # 1: a person carries the tag
        ("share", "f8"),  # share of the time walked while the tag was not at rest, with forgetting
        ("up", "f8", 3),  # u0, body frame
        ("m", "f8", 3),  # w, x, y of m, of any length; its z is zero
        ("shift", "f8"),  # rad
        ("rate", "f8"),  # rad/s, low-passed yaw rate
        ("turn", "f8"),  # rad, of the turn under way
        ("since_rest_s", "f8"),  # s since it was last quiet
        ("since_speed_s", "f8"),
        ("since_direction_s", "f8"),
    ]
)
Carrying: TypeAlias = Any  # a record of CARRYING

AUTO, VEHICLE, CARRIED = int(Motion.AUTO), int(Motion.VEHICLE), int(Motion.CARRIED)
SHARE_TAU = 20.0  # s
LEAST_SHARE = 0.05  # below, the tag moved for a minute without a step: it is a vehicle
TAU_ROUGH = 54.0  # s added to the time constant of the tilt at FULL_ROUGHNESS
FULL_ROUGHNESS = 1.0  # (m/s^2)^2
NEAR = 0.3  # cosine of the angle between up and u0 below which there is a new u0
UPSIDE_DOWN = -0.9  # the same, of a device that was turned over
UPRIGHT = 0.8  # upward component of body x above which it has no azimuth
SPEED_EVERY, DIRECTION_EVERY = 0.5, 1.5  # s
TURN_RATE, TURN_TAU, LEAST_TURN = 0.5, 0.3, 0.4  # rad/s, s, rad: a quick turn
SETTLE = 1.0  # s after a quick turn that the direction of the steps needs in addition
STEADY_RATE = 0.25  # rad/s, below which the direction of the steps is used
LEAST_COHERENCE = 0.3  # of the steps, below which they have no direction
SET_OFF, FIRST_SWING = 4.0, 0.8  # s after a rest, m/s^2: what looks like a step may begin a walk
RISING = 2.0  # m/s^2, of a swing that is not over: it may become a first step
SECOND_STEP = 0.8  # s, within which another one then comes
SLOW_WALK = 1.0  # m/s, that a walk of irregular steps may have had
CALM = 0.25  # (m/s^2)^2, variance of the acceleration of somebody who stands


@njit(cache=True, nogil=True)
def start_carrying(c: Carrying, size: float, motion: int) -> None:
    """Start with the size of one acceleration, m/s^2, and the setting."""
    start_gait(c.gait, size)
    c.stride.slow[:] = 0.0
    c.stride.low[:] = 0.0
    c.stride.sums[:] = 0.0
    c.motion = motion
    c.carried = 0
    c.share = 1.0
    c.shift = c.rate = c.turn = 0.0
    c.since_rest_s = c.since_speed_s = c.since_direction_s = 0.0


@njit(cache=True, nogil=True)
def add_carried_sample(c: Carrying, dt: float, acc: Array, a: Array, q: Array, gravity: float, moves: bool) -> None:
    """Take one acceleration: acc (body frame), a (its horizontal part, level frame), m/s^2."""
    size = math.sqrt(acc[0] * acc[0] + acc[1] * acc[1] + acc[2] * acc[2])
    add_step_sample(c.gait, dt, size)
    c.since_rest_s = c.since_rest_s + dt if moves else 0.0
    if c.carried == 0:
        return
    ux, uy, uz = up_in_body(q)
    add_stride_sample(c.stride, dt, a[0], a[1], ux * acc[0] + uy * acc[1] + uz * acc[2] - gravity)
    if moves:
        walks = 1.0 if c.gait.since_step_s < MAX_INTERVAL else 0.0
        c.share += dt / (SHARE_TAU + dt) * (walks - c.share)


@njit(cache=True, nogil=True)
def tilt_tau(c: Carrying, roughness: float) -> float:
    """Return the time constant of the tilt, s: steps shake it, and a swung device accelerates for long."""
    return TAU + TAU_ROUGH * min(1.0, roughness / FULL_ROUGHNESS) if c.carried == 1 else TAU


@njit(cache=True, nogil=True)
def decide_motion(c: Carrying, q: Array, yaw: float) -> None:
    """Set whether the tag is carried, from the setting or from its steps. yaw: azimuth of body x, rad."""
    if c.carried == 0:
        if c.motion == CARRIED or (c.motion == AUTO and c.gait.regular >= WALK):
            c.carried, c.share, c.shift, c.turn, c.rate = 1, 1.0, 0.0, 0.0, 0.0
            refer_up(c, q)
            c.shift = wrap(yaw - carried_yaw(c, q))
    elif c.motion == AUTO and c.share < LEAST_SHARE:
        c.carried = 0


@njit(cache=True, nogil=True)
def refer_up(c: Carrying, q: Array) -> None:
    """Take the present direction of up as the reference; z where it is near."""
    x, y, z = up_in_body(q)
    if z > NEAR:
        x, y, z = 0.0, 0.0, 1.0
    c.up[0], c.up[1], c.up[2] = x, y, z
    if z < UPSIDE_DOWN:
        c.m[0], c.m[1], c.m[2] = 0.0, 1.0, 0.0
    else:
        c.m[0], c.m[1], c.m[2] = 1.0 + z, -y, x


@njit(cache=True, nogil=True)
def carried_yaw(c: Carrying, q: Array) -> float:
    """Return the yaw of a carried device, rad."""
    w = q[0] * c.m[0] - q[1] * c.m[1] - q[2] * c.m[2]
    z = q[3] * c.m[0] + q[1] * c.m[2] - q[2] * c.m[1]
    return wrap(2.0 * math.atan2(z, w) + c.shift)


@njit(cache=True, nogil=True)
def carried_rate(a: Attitude) -> float:
    """Return the rate of that yaw, rad/s: of the last body rates about the vertical."""
    x, y, z = up_in_body(a.q)
    return x * (a.gyro[0] - a.bias[0]) + y * (a.gyro[1] - a.bias[1]) + z * (a.gyro[2] - a.bias[2])  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def yaw_of_carried(c: Carrying, q: Array) -> float:
    """Return the yaw, rad, and refer to another direction of up where the device was turned over."""
    yaw = carried_yaw(c, q)
    x, y, z = up_in_body(q)
    if x * c.up[0] + y * c.up[1] + z * c.up[2] < NEAR:
        refer_up(c, q)
        c.shift = wrap(c.shift + yaw - carried_yaw(c, q))
    return yaw


@njit(cache=True, nogil=True)
def fill_carried_node(c: Carrying, yaw: float, acc_var: float, node: Node) -> None:
    """Fill what the node of a carried tag has beside its yaw, rad. acc_var: that of `standstill`."""
    node.carried = c.carried
    node.walked = c.gait.walked
    node.stepping = 1 if c.gait.regular >= MM_PER_M * FULL_SWING or _sets_off(c) else 0
    if c.carried == 0:
        return
    node.dv_var = math.inf
    walks = c.gait.since_step_s < MAX_INTERVAL
    node.stands = 1 if not walks and acc_var < CALM else 0
    node.upright = 1 if abs(c.up[0]) > UPRIGHT else 0
    _fill_turn(c, node)
    c.since_speed_s += node.dt_s
    c.since_direction_s += node.dt_s
    if c.since_speed_s >= SPEED_EVERY and walks:
        node.step_speed = step_speed(c.gait)
        c.since_speed_s = 0.0
    if c.since_direction_s >= DIRECTION_EVERY and walks and c.gait.regular >= WALK:
        azimuth, coherence = stride_direction(c.stride)
        if coherence > LEAST_COHERENCE and abs(c.rate) < STEADY_RATE:
            node.gait_angle, node.gait_coherence = wrap(azimuth - yaw), coherence
            c.since_direction_s = 0.0


@njit(cache=True, nogil=True)
def _sets_off(c: Carrying) -> bool:
    """Return whether a tag that was at rest may have begun a walk, of steps still too few or irregular to tell."""
    g = c.gait
    if g.walked == 0.0:
        return bool(g.falling == 0 and g.peak - g.trough > RISING and c.since_rest_s < SET_OFF)
    stepped = g.swing > FIRST_SWING and g.since_step_s < SECOND_STEP
    walked_s = g.walked / SLOW_WALK if g.swing > FULL_SWING else 0.0
    return bool(stepped and c.since_rest_s < SET_OFF + walked_s + g.since_step_s)


@njit(cache=True, nogil=True)
def _fill_turn(c: Carrying, node: Node) -> None:
    """Fill `turned` at the end of a quick turn. The low-pass holds back the turn of its time constant."""
    if node.dt_s <= 0.0:
        return
    before = c.rate
    c.rate += min(1.0, node.dt_s / TURN_TAU) * (node.dyaw / node.dt_s - c.rate)
    if abs(c.rate) > TURN_RATE:
        c.turn = (before * TURN_TAU if c.turn == 0.0 else c.turn) + node.dyaw
    elif c.turn != 0.0:
        if abs(c.turn) > LEAST_TURN:
            node.turned = c.turn + node.dyaw - c.rate * TURN_TAU
            c.stride.sums[:] = 0.0
            c.since_direction_s = -SETTLE
        c.turn = 0.0

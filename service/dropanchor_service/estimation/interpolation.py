"""Poses between two known ones, and shortly after the last one. POSE (0-d) in and out."""

import math

import numpy as np

from dropanchor_service.estimation.columns import Array, State

S_PER_NS = 1e-9
SPEED_STD = 0.3  # m/s, of a published speed
ACCELERATION_STD = 1.0  # m/s², of somebody who walks or drives
YAW_RATE_STD = 0.1  # rad/s, of a published yaw rate
TURN_STD = 0.5  # rad/s², of the yaw rate's change


def propagated(pose: Array, t_ns: int) -> Array:
    """Return the pose dt s later at constant speed and yaw rate, with m = heading + w dt/2:

        x' = x + v dt cos m,  y' = y + v dt sin m,  heading' = heading + w dt,  P' = F P F^T + G Q G^T,
        Q = diag((SPEED_STD dt)² + (ACCELERATION_STD dt²/2)², (YAW_RATE_STD dt)² + (TURN_STD dt²/2)²),

    where Q is of the distance travelled and of the angle turned, and half of the turn acts on the way.
    """
    dt = (t_ns - int(pose["t_ns"])) * S_PER_NS
    rate = float(pose["yaw_rate"]) if math.isfinite(pose["yaw_rate"]) else 0.0
    middle, way = float(pose["heading"]) + rate * dt / 2, float(pose["speed"]) * dt
    c, s = math.cos(middle), math.sin(middle)
    F = np.array([[1.0, 0.0, -way * s], [0.0, 1.0, way * c], [0.0, 0.0, 1.0]])
    G = np.array([[c, -way * s / 2], [s, way * c / 2], [0.0, 1.0]])
    noise = ((SPEED_STD, ACCELERATION_STD), (YAW_RATE_STD, TURN_STD))
    Q = np.diag([(first * dt) ** 2 + (second * dt * dt / 2) ** 2 for first, second in noise])
    later = pose.copy()
    later["t_ns"] = t_ns
    later["x"] += way * c
    later["y"] += way * s
    later["heading"] = math.remainder(float(pose["heading"]) + rate * dt, math.tau)
    later["cov"] = F @ pose["cov"] @ F.T + G @ Q @ G.T
    later["parts"] = 0.0
    later["sigma_pos"] = math.sqrt(later["cov"][0, 0] + later["cov"][1, 1])
    return later


def interpolated(before: Array, after: Array, t_ns: int) -> Array:
    """Return the pose at t_ns between two: linear in continuous fields, the others from the pose that claims less.

    A lift may leave at any time, so the variance of the height is that of a mixture, with the share u of the second:

        (1 - u) z_std² + u z_std'² + u (1 - u) (z' - z)²
    """
    share = (t_ns - int(before["t_ns"])) / (int(after["t_ns"]) - int(before["t_ns"]))
    between = (before if after["state"] == State.TRACKING else after).copy()
    between["t_ns"] = t_ns
    for name in ("x", "y", "z", "speed", "yaw_rate", "cov", "range", "sigma_pos", "sigma_obs"):
        between[name] = (1 - share) * before[name] + share * after[name]
    variance = (1 - share) * before["z_std"] ** 2 + share * after["z_std"] ** 2
    between["z_std"] = math.sqrt(variance + share * (1 - share) * (after["z"] - before["z"]) ** 2)
    between["parts"] = 0.0
    turn = math.remainder(float(after["heading"]) - float(before["heading"]), math.tau)
    between["heading"] = math.remainder(float(before["heading"]) + share * turn, math.tau)
    between["p_mode"] = np.fmin(before["p_mode"], after["p_mode"])
    return between


def bridged(before: Array, after: Array, t_ns: int) -> Array:
    """Return what `interpolated` does, over a gap T in which the tag may have accelerated and turned.

    At the share u of the gap a motion of constant acceleration a is a u (1 - u) T²/2 off the straight one, so that

        P' = P + diag(p², p², h²),  p = ACCELERATION_STD u (1 - u) T²/2,  h = TURN_STD u (1 - u) T²/2 <= pi/sqrt(3),

    where the bound is that of a heading of which nothing is known.
    """
    gap = (int(after["t_ns"]) - int(before["t_ns"])) * S_PER_NS
    share = (t_ns - int(before["t_ns"])) * S_PER_NS / gap
    bow = share * (1 - share) * gap * gap / 2
    position, heading = ACCELERATION_STD * bow, min(TURN_STD * bow, math.pi / math.sqrt(3.0))
    between = interpolated(before, after, t_ns)
    between["cov"] = between["cov"] + np.diag([position**2, position**2, heading**2])
    between["sigma_pos"] = math.sqrt(between["cov"][0, 0] + between["cov"][1, 1])
    return between

"""The IMU front-end of one tag: IMU samples in, nodes out.

The result depends on the order of samples and node ends, not on how they were cut into batches.

A node's heading is ABSOLUTE_HEADING once field and gyroscope together know where north is: the azimuth of the body x
axis. Its error lasts for minutes, so `heading_var` is the variance of an error common to many nodes, which averaging
does not lower. Until then it is RELATIVE_HEADING, the integrated gyroscope since
start, zero arbitrary (RELATIVE_HEADING), with the variance it has gathered since.
"""

import math

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.attitude import (
    TAU,
    TILT_SD,
    Attitude,
    correct_tilt,
    predict_attitude,
    up_in_body,
    yaw_of,
    yaw_rate_of,
)
from dropanchor_service.estimation.fleet.frontend.carrying import (
    VEHICLE,
    add_carried_sample,
    carried_rate,
    carried_yaw,
    decide_motion,
    fill_carried_node,
    tilt_tau,
    yaw_of_carried,
)
from dropanchor_service.estimation.fleet.frontend.field import forget_turning, spread_yaw_on_arc
from dropanchor_service.estimation.fleet.frontend.large_bias import found_large_bias, may_be_at_rest
from dropanchor_service.estimation.fleet.frontend.level_ride import learn_from_level_ride
from dropanchor_service.estimation.fleet.frontend.magnetometer import north_of, update_magnetometer
from dropanchor_service.estimation.fleet.frontend.node import (
    ABSOLUTE_HEADING,
    MOVING,
    RELATIVE_HEADING,
    RESTING,
    Node,
)
from dropanchor_service.estimation.fleet.frontend.preintegration import (
    GYRO_NOISE,
    GYRO_SCALE,
    HORIZON,
    add_acceleration,
    end_node,
    unobserved_turn_var,
)
from dropanchor_service.estimation.fleet.frontend.standstill import (
    CONFIRM,
    at_rest,
    update_gyro_bias,
    update_standstill_detector,
)
from dropanchor_service.estimation.fleet.frontend.state import Frontend, start_at

GAP = 0.5  # s: a longer silence is not integrated over
USED, REPEATED, STUCK = range(3)  # what became of an IMU sample
FROZEN = 0.25  # s of samples that are equal to the last bit: no sensor is so quiet, its driver repeats itself
BIAS_LEFT = 1e-3  # rad/s, sd of the bias in motion after any rest
BIAS_TAU = 100.0  # s
ABSOLUTE_BELOW, RELATIVE_ABOVE = 0.2, 0.4  # rad^2, variance of north
HEADING_FLOOR = 2e-4  # rad^2: tilt and mounting, 0.8 deg


@njit(cache=True, nogil=True)
def lose_yaw_over_gap(f: Frontend, gap: float) -> None:
    """Add to the variance of yaw what it may have turned in `gap` s without samples."""
    f.preintegration.gap_s += max(0.0, gap - f.preintegration.extrapolated_s)
    f.standstill.quiet = 0.0
    f.attitude.age = min(f.attitude.age, TAU)  # the tilt is another one, too
    f.attitude.tilt_cov[0], f.attitude.tilt_cov[1] = TILT_SD * TILT_SD, 0.0
    if f.magnetometer.unit > 0.0:
        spread_yaw_on_arc(f.magnetometer, unobserved_turn_var(gap))
    f.drift_var += unobserved_turn_var(gap)


@njit(cache=True, nogil=True)
def learn_gyro_bias(f: Frontend, dt: float, gyro: Array, heard: bool) -> None:
    """Learn the gyroscope's bias at rest or on a level ride. Tilt and north then know how well a rest told it."""
    if heard and f.standstill.quiet <= CONFIRM:
        learn_from_level_ride(f.attitude, f.standstill, dt, gyro)
    before, P = f.standstill.bias_var, f.attitude.tilt_cov
    update_gyro_bias(f.standstill, dt, gyro, f.attitude.bias)
    variance = f.standstill.bias_var
    if variance >= before:
        return
    if variance < P[2]:
        P[1], P[2] = 0.0, variance
    forget_turning(f.magnetometer, variance)


@njit(cache=True, nogil=True)
def vertical_bias(a: Attitude) -> float:
    """Return the gyroscope's bias about the vertical, rad/s."""
    x, y, z = up_in_body(a.q)
    return x * a.bias[0] + y * a.bias[1] + z * a.bias[2]  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def learn_large_bias(f: Frontend, dt: float, gyro: Array, mag: Array) -> None:
    """Take a bias that is too large for the standstill to see a rest, and begin to look for north anew."""
    a = f.attitude
    if found_large_bias(f.large_bias, f.standstill, dt, gyro, a.bias, mag, a.q):
        f.bias_end = vertical_bias(a)  # no hypothesis has taken it for a change of a known bias
        f.magnetometer.unit = 0.0
        f.magnetometer.x[:] = 0.0


@njit(cache=True, nogil=True)
def is_frozen(f: Frontend, dt: float, acc: Array, gyro: Array) -> bool:
    """Return whether the IMU repeats its last sample, which must not look like a tag at rest."""
    same = True
    for i in range(3):
        same = same and gyro[i] == f.last[3 + i] and (acc[i] == f.last[i] or math.isnan(acc[i]))
        f.last[i], f.last[3 + i] = acc[i], gyro[i]
    f.frozen_s = f.frozen_s + dt if same else 0.0
    return f.frozen_s > FROZEN  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def use_acceleration(f: Frontend, dt: float, acc: Array, rest: bool) -> None:
    """Correct the tilt with a sample, m/s^2, and integrate it. rest: confirmed."""
    a, s, p, c = f.attitude, f.standstill, f.preintegration, f.carrying
    taken = correct_tilt(a, dt, acc[0], acc[1], acc[2], rest, p.acc_var, tilt_tau(c, p.acc_var))
    p.tilt_gain += 0.0 if rest else taken
    add_acceleration(p, dt, a.q, acc, a.gravity, s)
    if c.motion != VEHICLE:
        add_carried_sample(c, dt, acc, p.a, a.q, a.gravity, s.quiet == 0.0)
    if may_be_at_rest(f.large_bias, s):
        p.no_acc_s += dt  # where up is depends on it


@njit(cache=True, nogil=True)
def add_sample(f: Frontend, t_ns: int, acc: Array, gyro: Array, mag: Array) -> int:
    """Take one IMU sample (m/s^2, rad/s, any unit of field; acc and mag may be NaN). Skip one that is not newer.

    Return whether it was USED, or else why not.
    """
    if not math.isfinite(gyro[0] + gyro[1] + gyro[2]):
        return USED
    if f.running == 0:
        start_at(f, t_ns, acc, gyro)
        return USED
    dt = (t_ns - f.t_imu) * 1e-9
    if dt <= 0.0:
        return REPEATED
    if is_frozen(f, dt, acc, gyro):
        return STUCK
    f.t_imu = t_ns
    a, s, p, c = f.attitude, f.standstill, f.preintegration, f.carrying
    if dt > GAP:
        lose_yaw_over_gap(f, dt)
        a.gyro[:] = gyro
        dt = 0.0
    p.extrapolated_s = 0.0
    heard = math.isfinite(acc[0] + acc[1] + acc[2])
    if heard:
        update_standstill_detector(s, dt, acc, gyro, a.bias)
    else:
        s.quiet = 0.0
        p.no_acc_s += dt
    if c.carried == 0:  # the hand of somebody who stands turns slowly, which is no bias
        if heard:
            learn_large_bias(f, dt, gyro, mag)
        learn_gyro_bias(f, dt, gyro, heard)
    rest = s.quiet > CONFIRM and c.carried == 0
    predict_attitude(a, dt, gyro, rest)
    if heard:
        use_acceleration(f, dt, acc, rest)
    p.yaw_rate = 0.0 if rest else carried_rate(a) if c.carried == 1 else yaw_rate_of(a)
    update_magnetometer(f.magnetometer, dt, a.q, mag, rest, f.hard_iron, s.bias_var)
    return USED


@njit(cache=True, nogil=True)
def accumulate_drift(f: Frontend, dt: float, turned: float) -> None:
    """Update the variance of the integrated yaw: white noise and a Gauss-Markov bias."""
    f.turned += turned
    if f.standstill.quiet > CONFIRM:
        return
    f.drift_var += GYRO_NOISE * dt + 2.0 * f.drift_cov * dt
    f.drift_cov += -f.drift_cov * min(1.0, dt / BIAS_TAU) + (f.standstill.bias_var + BIAS_LEFT * BIAS_LEFT) * dt


@njit(cache=True, nogil=True)
def fill_heading(f: Frontend, psi: float, ahead: float, node: Node) -> None:
    """Fill the heading of the node from psi, the yaw at its end."""
    blind = unobserved_turn_var(max(0.0, ahead - HORIZON))
    north, variance = north_of(f.magnetometer)
    f.absolute = variance < (RELATIVE_ABOVE if f.absolute else ABSOLUTE_BELOW)
    if f.absolute:
        node.heading = wrap(psi - north + 0.5 * math.pi - f.declination)
        node.heading_var = variance + HEADING_FLOOR + blind
        node.heading_kind = ABSOLUTE_HEADING
    else:
        node.heading = wrap(psi)
        node.heading_var = f.drift_var + (GYRO_SCALE * f.turned) ** 2 + HEADING_FLOOR + blind
        node.heading_kind = RELATIVE_HEADING


@njit(cache=True, nogil=True)
def fill_unknown(dt: float, node: Node) -> None:
    """Fill a node before the first IMU sample."""
    node.dt_s = node.unobserved_s = dt
    node.dyaw_var = unobserved_turn_var(dt)
    node.dv_var = node.heading_var = math.inf


@njit(cache=True, nogil=True)
def fill_gyro_bias(f: Frontend, node: Node) -> None:
    """Fill the variance of the gyroscope's bias about the vertical, its change in this node, and the tilt it causes."""
    bias = vertical_bias(f.attitude)
    node.gyro_bias_var = f.standstill.bias_var
    node.gyro_bias_step = bias - f.bias_end if at_rest(f.standstill) else 0.0
    f.bias_end = bias
    _, cov, variance = f.attitude.tilt_cov
    node.gyro_tilt_var = cov * cov / variance if variance > 0.0 else 0.0


@njit(cache=True, nogil=True)
def yaw_now(f: Frontend) -> float:
    """Return the yaw, rad, as it is told for what moves the tag. A change of that is no turn."""
    c, q = f.carrying, f.attitude.q
    was_carried, yaw = c.carried, yaw_of(q)
    decide_motion(c, q, yaw)
    if c.carried == 1:
        return yaw_of_carried(c, q)
    if was_carried == 1:
        f.preintegration.yaw_end = wrap(f.preintegration.yaw_end + yaw - carried_yaw(c, q))
    return yaw


@njit(cache=True, nogil=True)
def close_node(f: Frontend, t_ns: int, node: Node) -> None:
    """End a node at t_ns, not before the last IMU sample or node, and begin the next.

    Fill dt_s, dyaw, dv, heading and rest of `node` with their variances.
    """
    dt = (t_ns - f.t_node) * 1e-9 if f.t_node > 0 else 0.0
    if f.running == 0:
        f.t_node = t_ns
        fill_unknown(dt, node)
        return
    ahead = (t_ns - f.t_imu) * 1e-9
    f.t_node = t_ns
    yaw = yaw_now(f)
    psi = end_node(f.preintegration, yaw, ahead, dt, node)
    accumulate_drift(f, dt, node.dyaw)
    node.dt_s = dt
    fill_carried_node(f.carrying, yaw, f.standstill.acc_var, node)
    fill_gyro_bias(f, node)
    fill_heading(f, psi, ahead, node)
    node.rest = RESTING if at_rest(f.standstill) and ahead < GAP else MOVING

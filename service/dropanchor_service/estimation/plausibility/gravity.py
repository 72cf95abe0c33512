"""Gravity: whether the accelerations contain it, in m/s², and whether their sign is right."""

from typing import Final

from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.plausibility.layout import GOOD, Check, may_be_used
from dropanchor_service.estimation.plausibility.vectors import Vector, combined, cross, dot, norm
from dropanchor_service.estimation.plausibility.verdicts import ImuVerdict

# Half-second means of 36 recordings, phones and walkers among them, lie within 7.6 and 14.4 m/s², their medians within
# 9.8 and 10.3.
LEAST, MOST = 5.5, 20.0  # m/s², |mean| of a block
SLOW_LEAST, SLOW_MOST = 8.0, 12.0  # m/s², slow mean of that
SLOW_S: Final = 10.0
LEVEL_S: Final = 20.0
WRONG_S: Final = 1.0  # nothing falls freely for so long
RIGHT_S: Final = 2.0
NAMED_S: Final = 2.0  # from which on a unit is named
ONE_G = (0.8, 1.25)  # m/s², accelerations in g
POINTS_ONE_WAY: Final = 0.7  # |mean| over mean of the norm: accelerations with gravity in them
STUCK_S: Final = 3.0
ALIVE_S: Final = 0.5
UPSIDE: Final = -0.7  # up along body z
DIP: Final = 0.3  # up component of the field over its length; north of the equator it points down
SURE_S, LONGEST_S = 2.0, 4.0
LEAST_TURNING: Final = 0.6  # rad²/s
LEAST_SPEED: Final = 0.3  # m/s
FORGET_S: Final = 60.0

ACC_IN_G, ACC_IN_MG, ACC_SCALE, ACC_NO_GRAVITY, ACC_SILENT, ACC_STUCK, ACC_REVERSED = map(int, list(ImuVerdict)[1:8])
UPSIDE_DOWN = int(ImuVerdict.UPSIDE_DOWN)


@njit(nogil=True)
def judge_gravity(c: Check, acc: Vector, seconds: float, acc_same_s: float, gyro_same_s: float) -> int:
    """Return the verdict on the accelerations, given the present one.

    acc: mean of the block, m/s². acc_same_s, gyro_same_s: for which each has repeated itself.
    """
    length = norm(acc)
    stuck = acc_same_s > STUCK_S and gyro_same_s < ALIVE_S and length > 0.0
    first, was_right = c.known_s == 0.0, c.right_s > 0.0
    wrong = length < LEAST or length > MOST
    c.known_s += seconds
    c.norm += (length - c.norm) * seconds / min(c.known_s, SLOW_S)
    gain = seconds / min(c.known_s, LEVEL_S)
    for i in range(3):
        c.level[i] += (acc[i] - c.level[i]) * gain
    c.wrong_s = c.wrong_s + seconds if wrong else 0.0
    c.right_s = 0.0 if wrong or stuck else c.right_s + seconds
    if stuck:
        return ACC_STUCK
    within = SLOW_LEAST < c.norm < SLOW_MOST
    if may_be_used(c.imu_verdict):
        if c.wrong_s >= WRONG_S or (wrong and first):
            _restart_means(c, acc, seconds)
            return _unit(c)
        return int(c.imu_verdict) if within or c.known_s <= SLOW_S else _unit(c)
    if not ACC_IN_G <= c.imu_verdict <= ACC_STUCK:
        return int(c.imu_verdict)
    if c.right_s > 0.0:
        if not was_right:  # what was wrong before says no more
            _restart_means(c, acc, seconds)
        return GOOD if c.right_s >= RIGHT_S and within else int(c.imu_verdict)
    return ACC_STUCK if c.imu_verdict == ACC_STUCK else _unit(c)


@njit(nogil=True)
def _restart_means(c: Check, acc: Vector, seconds: float) -> None:
    """Begin the slow means with this block."""
    c.known_s, c.norm = seconds, norm(acc)
    for i in range(3):
        c.level[i] = acc[i]


@njit(nogil=True)
def _unit(c: Check) -> int:
    """Return what the slow means of a wrong accelerometer look like."""
    c.imu_detail = c.norm
    if c.norm == 0.0:
        return ACC_SILENT
    one_way = norm((c.level[0], c.level[1], c.level[2])) > POINTS_ONE_WAY * c.norm
    if c.known_s < NAMED_S and c.norm > ONE_G[0] / 2:
        return ACC_SCALE
    if ONE_G[0] < c.norm < ONE_G[1] and one_way:
        return ACC_IN_G
    if 1e3 * ONE_G[0] < c.norm < 1e3 * ONE_G[1] and one_way:
        return ACC_IN_MG
    if c.norm < LEAST and (not one_way or c.norm < ONE_G[0]):
        return ACC_NO_GRAVITY
    return ACC_SCALE


@njit(nogil=True)
def judge_sign(c: Check, acc: Vector, gyro: Vector, mag: Vector, has_mag: bool, seconds: float) -> int:
    """Return ACC_REVERSED if the tag seems to hang upside down and something says that it does not.

    A tag that really hangs so shows a field that points down into the ground, north of the equator, and an acceleration
    towards the inside of its turns. Reversed accelerations turn both round.
    """
    length = norm(acc)
    upside = acc[2] < UPSIDE * length
    if upside and c.upside_s == 0.0:
        c.left = c.left_rate = 0.0  # of other accelerations
    c.upside_s = min(LONGEST_S, c.upside_s + seconds) if upside else max(0.0, c.upside_s - seconds)
    points_up = has_mag and dot(mag, acc) > DIP * norm(mag) * length
    c.dip_s = min(LONGEST_S, c.dip_s + seconds) if points_up else max(0.0, c.dip_s - seconds)
    _add_turn(c, acc, gyro, seconds)
    if c.sign_known or not (may_be_used(c.imu_verdict) or c.imu_verdict == ACC_REVERSED):
        return int(c.imu_verdict)
    found = _sign(c, has_mag)
    if found != GOOD or c.imu_verdict in (ACC_REVERSED, UPSIDE_DOWN):
        return found
    return int(c.imu_verdict)


@njit(nogil=True)
def _sign(c: Check, has_mag: bool) -> int:
    """Return ACC_REVERSED, UPSIDE_DOWN if that or a tag that hangs so cannot be told apart yet, or GOOD."""
    if c.upside_s < SURE_S:
        return ACC_REVERSED if c.upside_s > 0.0 and c.imu_verdict == ACC_REVERSED else GOOD
    turned = c.left_rate > LEAST_TURNING
    outwards, inwards = turned and c.left < -LEAST_SPEED * c.left_rate, turned and c.left > LEAST_SPEED * c.left_rate
    if c.imu_verdict == ACC_REVERSED or (outwards and not has_mag):
        return ACC_REVERSED
    if has_mag:
        return ACC_REVERSED if c.dip_s >= SURE_S and not inwards else GOOD
    if inwards:
        c.sign_known = 1
        return GOOD
    return UPSIDE_DOWN


@njit(nogil=True)
def _add_turn(c: Check, acc: Vector, gyro: Vector, seconds: float) -> None:
    """Add yaw rate times acceleration to the left: its mean over the mean square of the rate is a speed ahead."""
    level = (float(c.level[0]), float(c.level[1]), float(c.level[2]))
    length = norm(level)
    if length < LEAST:
        return
    up = combined(level, 1.0 / length, level, 0.0)
    left = cross(up, (1.0, 0.0, 0.0))
    side = norm(left)
    if side < 0.5:  # body x is upright
        return
    rate = dot(gyro, up)
    kept = 1.0 - seconds / FORGET_S
    c.left = kept * c.left + rate * dot(combined(acc, 1.0, level, -1.0), left) / side * seconds
    c.left_rate = kept * c.left_rate + rate * rate * seconds

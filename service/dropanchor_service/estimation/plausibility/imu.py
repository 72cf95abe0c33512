"""Take the IMU samples of one tag: sum them in blocks of half a second, and judge each block when it ends."""

import math
from typing import Any, Final

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.plausibility.gravity import ALIVE_S, judge_gravity, judge_sign
from dropanchor_service.estimation.plausibility.layout import GOOD, Check, may_be_used
from dropanchor_service.estimation.plausibility.turning import judge_field, judge_turning
from dropanchor_service.estimation.plausibility.vectors import Vector, combined, norm
from dropanchor_service.estimation.plausibility.verdicts import ImuVerdict

G: Final = 9.80665  # m/s²
BLOCK_NS: Final = 500_000_000
GAP_NS: Final = 1_000_000_000  # after which a block begins anew
APART_S: Final = 0.9  # between the middles of two blocks that are compared
MOVED: Final = 0.15  # m/s², between two blocks: no tag at rest shows that
MOVED_BLOCKS: Final = 6
VIGOROUS: Final = 8.5  # m/s², between two blocks
NEAR_G: Final = 3.0  # m/s², beyond which half of that is vigorous
FARTHEST: Final = 17.0  # m/s², of a mean: beyond, it is another unit or scale
MODERATE_S: Final = 3.0  # without vigorous motion, before an IMU is judged again
ABSURD_IN_A_ROW: Final = 20
ACC_SCALE, AXES_DIFFER = int(ImuVerdict.ACC_SCALE), int(ImuVerdict.AXES_DIFFER)
GYRO_IN_DEG = int(ImuVerdict.GYRO_IN_DEG)
GYRO_STUCK, RAW_COUNTS = int(ImuVerdict.GYRO_STUCK), int(ImuVerdict.RAW_COUNTS)


@njit(nogil=True)
def add_imu(c: Check, imu: Array, first: int, end: int) -> None:
    """Add the samples `first` to `end` of IMU, all of this tag, and judge each block that they end.

    A sample that is not newer is skipped. The sums of a block are kept in registers: half of the cost is memory.
    """
    i = first
    while i < end:
        since = imu[i].t_ns - c.t_ns
        if not 0 < since <= GAP_NS or c.n == 0:
            if c.n > 0 and -GAP_NS < since <= 0:
                i += 1
                continue
            _begin_anew(c, imu[i])
        elif imu[i].t_ns - c.begin_ns >= BLOCK_NS:
            _end_block(c, (imu[i].t_ns - c.begin_ns) * 1e-9)
            _begin_block(c, imu[i].t_ns)
        i = _fill_block(c, imu, i, end)


@njit(nogil=True)
def _fill_block(c: Check, imu: Array, first: int, end: int) -> int:
    """Add the samples that belong to the block, at least the first one. Return the index behind them."""
    t_ns, i = c.t_ns, first
    acc_ns, gyro_ns = c.acc_ns, c.gyro_ns
    ax, ay, az, gx, gy, gz = c.last[0], c.last[1], c.last[2], c.last[3], c.last[4], c.last[5]
    sum_ax, sum_ay, sum_az = c.acc[0], c.acc[1], c.acc[2]
    sum_gx, sum_gy, sum_gz = c.gyro[0], c.gyro[1], c.gyro[2]
    sum_mx, sum_my, sum_mz = c.mag[0], c.mag[1], c.mag[2]
    last_ns = c.begin_ns + BLOCK_NS
    while i < end:
        sample = imu[i]
        now = sample.t_ns
        if i > first and not (t_ns < now < last_ns and now - t_ns <= GAP_NS):
            break
        a, w, m = sample.acc, sample.gyro, sample.mag
        if a[0] != ax or a[1] != ay or a[2] != az:
            acc_ns = now
        if w[0] != gx or w[1] != gy or w[2] != gz:
            gyro_ns = now
        ax, ay, az, gx, gy, gz = a[0], a[1], a[2], w[0], w[1], w[2]
        sum_ax += ax
        sum_ay += ay
        sum_az += az
        sum_gx += gx
        sum_gy += gy
        sum_gz += gz
        sum_mx += m[0]
        sum_my += m[1]
        sum_mz += m[2]
        t_ns = now
        i += 1
    c.t_ns, c.acc_ns, c.gyro_ns = t_ns, acc_ns, gyro_ns
    c.n += i - first
    c.last[0], c.last[1], c.last[2], c.last[3], c.last[4], c.last[5] = ax, ay, az, gx, gy, gz
    c.acc[0], c.acc[1], c.acc[2] = sum_ax, sum_ay, sum_az
    c.gyro[0], c.gyro[1], c.gyro[2] = sum_gx, sum_gy, sum_gz
    c.mag[0], c.mag[1], c.mag[2] = sum_mx, sum_my, sum_mz
    return i


@njit(nogil=True)
def add_absurd(c: Check, size: float) -> None:
    """Note a sample beyond what sensors measure. size: its greatest value."""
    c.absurd_imu += 1
    if c.absurd_imu >= ABSURD_IN_A_ROW and may_be_used(c.imu_verdict):
        c.imu_verdict, c.imu_detail = RAW_COUNTS, size


@njit(nogil=True)
def _begin_anew(c: Check, sample: Any) -> None:
    """Begin after a gap, or at another time."""
    c.before.n = 0
    c.calm_ns = 0
    c.acc_ns = c.gyro_ns = sample.t_ns
    _begin_block(c, sample.t_ns)


@njit(nogil=True)
def _begin_block(c: Check, t_ns: int) -> None:
    c.begin_ns = t_ns
    c.n = 0
    c.absurd_imu = 0
    for i in range(3):
        c.acc[i] = c.gyro[i] = c.mag[i] = 0.0


@njit(nogil=True)
def repeated_s(c: Check, since_ns: int) -> float:
    """Return for how long a value has been the same, s."""
    return float(c.t_ns - since_ns) * 1e-9


@njit(nogil=True)
def _end_block(c: Check, seconds: float) -> None:
    """Judge the block. seconds: its length."""
    n, middle_ns = c.n, c.begin_ns + (c.t_ns - c.begin_ns) // 2
    acc: Vector = (c.acc[0] / n, c.acc[1] / n, c.acc[2] / n)
    gyro: Vector = (c.gyro[0] / n, c.gyro[1] / n, c.gyro[2] / n)
    mag: Vector = (c.mag[0] / n, c.mag[1] / n, c.mag[2] / n)
    has_mag = math.isfinite(mag[0] + mag[1] + mag[2])
    if math.isfinite(acc[0] + acc[1] + acc[2]):
        _judge(c, acc, gyro, mag, has_mag, seconds, (middle_ns - c.before.t_ns) * 1e-9)
    c.before.t_ns, c.before.n = middle_ns, n
    for i in range(3):
        c.before.acc[i], c.before.gyro[i] = acc[i], gyro[i]
        c.before.mag[i] = mag[i]


@njit(nogil=True)
def _judge(c: Check, acc: Vector, gyro: Vector, mag: Vector, has_mag: bool, seconds: float, apart: float) -> None:
    """Give each of the judges its turn. The first fault stays until the judge who found it takes it back.

    Vigorous motion, such as the figure of eight that calibrates a compass, is not judged: within half a second it turns
    to and fro, and what is not gravity is as large as gravity.
    """
    follows = c.before.n > 0 and apart < APART_S
    if follows:
        _settle(c, _judge_gyro_alive(c, acc))
        if _is_vigorous(c, acc):
            _suspend(c)
    if c.vigorous_s > 0.0:
        c.vigorous_s = max(0.0, c.vigorous_s - seconds)
        return
    c.held_s += seconds
    _settle(c, judge_gravity(c, acc, seconds, repeated_s(c, c.acc_ns), repeated_s(c, c.gyro_ns)))
    if c.imu_verdict == RAW_COUNTS:
        _settle(c, GOOD)
    if follows:
        _settle(c, judge_turning(c, acc, gyro, c.n, seconds, apart))
        if has_mag and math.isfinite(c.before.mag[0]):
            _settle(c, judge_field(c, gyro, mag, apart))
    _settle(c, judge_sign(c, acc, gyro, mag, has_mag, seconds))


@njit(nogil=True)
def _is_vigorous(c: Check, acc: Vector) -> bool:
    """Return whether the mean acceleration differs from that of the block before as only swinging makes it differ."""
    before: Vector = (c.before.acc[0], c.before.acc[1], c.before.acc[2])
    length, change = norm(acc), norm(combined(acc, 1.0, before, -1.0))
    if max(length, norm(before)) > FARTHEST:
        return False
    return change > VIGOROUS or (change > 0.5 * VIGOROUS and abs(length - G) > NEAR_G)


@njit(nogil=True)
def _suspend(c: Check) -> None:
    """Judge no more until the motion is moderate. What its first half second has shown, counts no more either."""
    if c.vigorous_s == 0.0:
        _forget(c)
    is_fresh = c.held_s < MODERATE_S and c.imu_verdict in (AXES_DIFFER, GYRO_IN_DEG)
    if is_fresh or c.imu_verdict == ACC_SCALE:
        _settle(c, GOOD)
        c.known_s = 0.0
    c.vigorous_s, c.right_s, c.calm_ns = MODERATE_S, 0.0, 0


@njit(nogil=True)
def _judge_gyro_alive(c: Check, acc: Vector) -> int:
    """Return GYRO_STUCK if the rates are one value while the tag moves."""
    before: Vector = (c.before.acc[0], c.before.acc[1], c.before.acc[2])
    stuck = repeated_s(c, c.gyro_ns) > ALIVE_S and repeated_s(c, c.acc_ns) < ALIVE_S
    if c.imu_verdict == GYRO_STUCK:
        return GYRO_STUCK if stuck else GOOD
    c.moved = c.moved + (norm(combined(acc, 1.0, before, -1.0)) > MOVED) if stuck else 0
    if may_be_used(c.imu_verdict) and c.moved >= MOVED_BLOCKS:
        return GYRO_STUCK
    return int(c.imu_verdict)


@njit(nogil=True)
def _settle(c: Check, verdict: int) -> None:
    """Take over a verdict. What was summed before belongs to sensors that have changed since."""
    if verdict == c.imu_verdict:
        return
    if may_be_used(verdict) != may_be_used(c.imu_verdict):
        c.upside_s = c.upside_s if verdict != GOOD else 0.0
        c.dip_s = 0.0
        c.moved = 0
        _forget(c)
    c.imu_verdict, c.held_s = verdict, 0.0


@njit(nogil=True)
def _forget(c: Check) -> None:
    """Begin anew with what turns show."""
    c.tilted = c.contradicted = c.turned = c.peak = c.doubted_s = 0.0
    c.left = c.left_rate = 0.0
    c.field_blocks = 0
    c.field2 = 0.0
    for i in range(3):
        c.rates[i] = 0.0
    for i in range(4):
        c.told[i] = 0.0
        for j in range(4):
            c.normal[i, j] = 0.0

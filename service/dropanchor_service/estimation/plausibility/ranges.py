"""Take the ranges of one tag to one anchor: whether they are metres, and whether the module averages them.

Second differences of ranges hardly know how a tag moves: they are noise, in the unit of the ranges. A step from range
to range less the mean of the steps around it is what the errors changed. With independent errors these changes are
correlated by -1/2 at a lag of 1, and hardly later. With a mean of N ranges, which gains one range and loses another at
each step, they are correlated by -1/2 at a lag of N, and hardly before.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.plausibility.layout import AROUND, LAGS, Check
from dropanchor_service.estimation.plausibility.verdicts import RangeVerdict

SILENT_S: Final = 5.0  # after which another anchor is judged
EVEN: Final = 0.4  # by which the time between two ranges may differ from its mean, as a share of that
KEPT: Final = 400  # ranges
CLIP: Final = 4.5  # medians beyond which a change counts no more
MEDIAN_STEP: Final = 1.05  # factor by which a running median moves
STD_OF_MEDIAN: Final = 1.48
LEAST_N, LEAST_S = 4, 0.3  # a shorter mean does no harm
SIGN: Final = -0.4  # of -0.5, which a mean of N shows at lag N
SMOOTH: Final = 0.25  # at lag 1, either way: independent errors show -0.5 there, and motion nearly 1
LEAST_CHANGES: Final = 100
LEAST_CHANGE: Final = 0.004  # m, median: less is no noise of a radio
ROUGH: Final = 1.25  # second difference over change, medians: 1.8 for independent errors, 1.4 for a mean, 0 for motion
DEVIATION: Final = 1.22  # of a correlation, times the root of the number of changes
SURE: Final = 5.0  # standard deviations
GONE: Final = -0.25
CALM: Final = 100  # ranges
NOISE_M: Final = 5.0  # of a range, eight times that of the worst recording
NOISE_MM: Final = 25.0
NOISE_RANGES: Final = 20
CLOSE_S: Final = 0.35  # between ranges: further apart, motion is part of a second difference
WINDOW_S: Final = 1.0
FASTEST: Final = 40.0  # m/s
MEMORY: Final = 0.1
OFTEN, SELDOM = 0.45, 0.1
ABSURD_MEMORY: Final = 0.05
ABSURD, NOT_ABSURD = 0.3, 0.05

GOOD, IN_MM, IN_CM, AVERAGED = map(int, RangeVerdict)


@njit(nogil=True)
def add_range(c: Check, t_ns: int, anchor: int, range_m: float) -> None:
    """Add one range, and judge. Ranges to other anchors are left out while this one is heard."""
    since = (t_ns - c.range_ns) * 1e-9
    c.absurd_ranges -= ABSURD_MEMORY * c.absurd_ranges
    if c.range_n == 0 or anchor != c.anchor or abs(since) > SILENT_S:
        if c.range_n > 0 and anchor != c.anchor and abs(since) <= SILENT_S:
            return
        _begin(c, t_ns, anchor, range_m)
        return
    if since <= 0.0:
        return
    _add_to_window(c, t_ns, range_m)
    _add_step(c, range_m - c.range, _is_even(c, since))
    c.range_ns, c.range = t_ns, range_m
    c.range_n += 1
    _judge(c)


@njit(nogil=True)
def add_absurd_range(c: Check) -> None:
    """Note a range beyond the reach of radios."""
    c.absurd_ranges += ABSURD_MEMORY * (1.0 - c.absurd_ranges)
    if c.absurd_ranges > ABSURD and c.range_verdict == GOOD:
        c.range_verdict = IN_MM


@njit(nogil=True)
def _begin(c: Check, t_ns: int, anchor: int, range_m: float) -> None:
    c.anchor, c.range_ns, c.range_n = anchor, t_ns, 1
    c.range = range_m
    c.range_dt[0] = c.range_dt[1] = 0.0
    c.second = c.left_size = 0.0
    c.products_n = 0
    c.window_ns = t_ns
    c.window[0], c.window[1], c.window_before = range_m, 1.0, math.nan
    c.calm = 0
    for k in range(AROUND):
        c.steps[k] = math.nan
    for k in range(LAGS):
        c.left_over[k] = math.nan
        c.products[k] = 0.0


@njit(nogil=True)
def _add_to_window(c: Check, t_ns: int, range_m: float) -> None:
    """Update the share of seconds in which the mean range changes faster than anything moves."""
    if (t_ns - c.window_ns) * 1e-9 >= WINDOW_S:
        mean = c.window[0] / c.window[1]
        seconds = (t_ns - c.window_ns) * 1e-9
        if math.isfinite(c.window_before):
            fast = 1.0 if abs(mean - c.window_before) > FASTEST * seconds else 0.0
            c.fast += MEMORY * (fast - c.fast)
        c.window_before, c.window_ns = mean, t_ns
        c.window[0] = c.window[1] = 0.0
    c.window[0] += range_m
    c.window[1] += 1.0


@njit(nogil=True)
def _is_even(c: Check, since: float) -> bool:
    """Return whether this range and the one before it came in their usual time."""
    usual = c.range_dt[0]
    c.range_dt[0] = since if usual == 0.0 else usual + 0.05 * (since - usual)
    even = bool(abs(since - usual) < EVEN * usual and abs(c.range_dt[1] - usual) < EVEN * usual)
    c.range_dt[1] = since
    return even


@njit(nogil=True)
def _followed(median: float, size: float) -> float:
    """Return a running median after one more value."""
    if median == 0.0:
        return size
    return median * MEDIAN_STEP if size > median else median / MEDIAN_STEP


@njit(nogil=True)
def _add_step(c: Check, step: float, even: bool) -> None:
    """Add a step from range to range, m, and compare what the errors changed in the middle of the last steps."""
    for k in range(AROUND - 1, 0, -1):
        c.steps[k] = c.steps[k - 1]
    c.steps[0] = step if even else math.nan
    if even and math.isfinite(c.steps[1]):
        c.second = _followed(c.second, abs(step - c.steps[1]))
    total = 0.0
    for k in range(AROUND):
        total += c.steps[k]
    _compare(c, c.steps[AROUND // 2] - total / AROUND)


@njit(nogil=True)
def _compare(c: Check, change: float) -> None:
    """Add a change of the errors, NaN if it is not known, to the mean products by lag."""
    for k in range(LAGS - 1, 0, -1):
        c.left_over[k] = c.left_over[k - 1]
    c.left_over[0] = math.nan
    if not math.isfinite(change):
        return
    c.left_size = _followed(c.left_size, abs(change))
    c.left_over[0] = min(max(change, -CLIP * c.left_size), CLIP * c.left_size)
    c.products_n = min(c.products_n + 1, KEPT)
    gain, now = 1.0 / c.products_n, c.left_over[0]
    for k in range(LAGS):
        if math.isfinite(c.left_over[k]):
            c.products[k] += gain * (now * c.left_over[k] - c.products[k])


@njit(nogil=True)
def _averaged(c: Check) -> tuple[int, float]:
    """Return the number of ranges that a mean would have, and the correlation at that lag."""
    best, sign = 0, 0.0
    is_noise = c.left_size > LEAST_CHANGE and c.second > ROUGH * c.left_size
    if is_noise and abs(c.products[1]) < SMOOTH * c.products[0]:
        for lag in range(LEAST_N, LAGS):
            at = c.products[lag] / c.products[0]
            if at < sign:
                best, sign = lag, at
    return best, sign


@njit(nogil=True)
def _judge(c: Check) -> None:
    noise = STD_OF_MEDIAN * c.second / math.sqrt(6.0)
    close = c.range_dt[0] < CLOSE_S and c.range_n >= NOISE_RANGES
    wrong_unit = c.fast > OFTEN or (close and noise > NOISE_M)
    if c.range_verdict == GOOD and wrong_unit:
        c.range_verdict = IN_MM if close and noise > NOISE_MM else IN_CM
        return
    if c.range_verdict in (IN_MM, IN_CM):
        if c.fast < SELDOM and c.absurd_ranges < NOT_ABSURD and not (close and noise > NOISE_M):
            c.range_verdict = GOOD
        return
    number, sign = _averaged(c)
    sure = sign * math.sqrt(c.products_n) < -SURE * DEVIATION and c.products_n >= LEAST_CHANGES
    if c.range_verdict == AVERAGED:
        c.calm = c.calm + 1 if sign > GONE and c.products_n >= LEAST_CHANGES else 0
        if c.calm > CALM:
            c.range_verdict = GOOD
    elif close and sign < SIGN and sure and number * c.range_dt[0] > LEAST_S:
        c.range_verdict, c.range_detail, c.calm = AVERAGED, number, 0

"""The height of one tag: a small filter beside the hypotheses, fed by a barometer.

State: height z, m, vertical speed w, m/s, and what the barometer shows beyond z, b, m. With T the temperature of the
air and L the logarithm of the pressure of a reference, or of the tag's first sample,

    y = K T (L - log p) = z + b + noise        K = R / (g M), the hypsometric equation

    z' = z + w dt        w is a Gauss-Markov process        b is a random walk: the weather, and drift of the sensor

A pressure that jumps is height or air, and nothing here tells which: both become as unsure as it jumps, and share it.
That a barometer is late is an error of its speed times the delay.

A reference is a tag whose barometer does not move: its b is the weather, which is taken out of y. A tag that is told to
be flat has no filter, nor has one that is told nothing and sends no pressure.
"""

import math
from typing import Any, Final, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node

AUTO, FLAT, FREE, REFERENCE = range(4)  # the setting `height_motion`
TOLD, BY_PRESSURE, UNKNOWN = range(3)  # where the height of a node comes from
ACCEPTED, DOUBTED, UNUSED = range(3)  # what became of a pressure

K: Final = 29.2713  # m/K, gas constant over gravity and molar mass of dry air
STANDARD_AIR: Final = 288.15  # K, of air whose temperature nobody told: the standard atmosphere at sea level
ZERO_CELSIUS: Final = 273.15  # K
AIR_STD, TOLD_AIR_STD = 12.0, 3.0  # K, error of that temperature, and of a told one: it scales every climb
NOISE_STD: Final = 0.2  # m, of one pressure: 0.1 to 0.2 m by the data sheets, and draughts
SPEED_STD: Final = 1.0  # m/s, vertical: lifts and stairs below it, drones up to three times it
SPEED_TAU: Final = 3.0  # s in which a vertical speed becomes another one
DRIFT: Final = 0.15**2 / 30.0  # m^2/s, of b without a reference: 0.15 m in 30 s, on a day of changing weather
DRIFT_REFERRED: Final = 0.15**2 / 600.0  # m^2/s, the same with one: two sensors warm up, the air of a building moves
HEIGHT_BOUND: Final = 10.0  # m, the largest standard deviation of a height: that of a tag of which nobody knows it
REFERENCE_S: Final = 30.0  # s without a pressure after which a reference has died: its last level is kept
JUMP_GATE: Final = 5.0  # standard deviations: an innovation beyond is in doubt
DOUBT_S: Final = 2.0  # s after which it has jumped: a door slams for 1 s, and a lift takes longer
LATE_STD: Final = 1.5  # s, of how late a barometer is: behind a vent, or filtered
MAX_STEP_S: Final = 1.0  # s of prediction at once
FORGOTTEN_S: Final = 100.0  # s without a sample after which nothing is known but the bound

HEIGHT: Final = np.dtype(
    [
        ("motion", "u1"),  # AUTO, FLAT, FREE or REFERENCE
        ("running", "u1"),  # 1: the height is a state
        ("fed", "u1"),  # 1: a pressure has come
        ("referred", "u1"),  # 1: b counts from the reference
        ("air_told", "u1"),  # 1: the last pressure told the temperature of the air
        ("reference", "i4"),  # row of the reference, -1: none
        ("told", "f8"),  # m, height at the start
        ("x", "f8", 3),  # z, w, b
        ("P", "f8", (3, 3)),
        ("t_ns", "i8"),  # of the state
        ("pressure_ns", "i8"),  # of the last pressure
        ("reference_ns", "i8"),  # of the last pressure of the reference
        ("shared_ns", "i8"),  # the same, when the batch began; 0: the reference tells nothing
        ("shared_level", "f8"),  # log Pa, that the reference showed then
        ("shared_var", "f8"),  # m^2, of it
        ("level", "f8"),  # log Pa, from which y counts: the first pressure, or the last one of the reference
        ("doubt", "f8"),  # m, innovation that is in doubt; 0: none
        ("doubt_ns", "i8"),  # since when
    ],
    align=True,
)
Height: TypeAlias = Any  # a record of HEIGHT


@njit(cache=True, nogil=True)
def start_height(h: Height, motion: int, told: float, std: float) -> None:
    """Begin with the height that the settings tell, m, and its standard deviation."""
    h.motion, h.told, h.reference = motion, told, -1
    h.fed = h.referred = h.air_told = 0
    h.running = 1 if motion in (FREE, REFERENCE) else 0
    h.t_ns = h.pressure_ns = h.reference_ns = h.shared_ns = h.doubt_ns = 0
    h.level = h.shared_level = h.shared_var = h.doubt = 0.0
    h.x[0], h.x[1], h.x[2] = told, 0.0, 0.0
    h.P[:] = 0.0
    if motion != REFERENCE:
        h.P[0, 0], h.P[1, 1] = std * std, SPEED_STD**2


@njit(cache=True, nogil=True)
def add_pressure(h: Height, t_ns: int, pressure: float, temperature: float) -> int:
    """Take a pressure, Pa, in air of this temperature, °C or NaN. Return what became of it."""
    if h.motion == FLAT:
        return UNUSED
    _predict_to(h, t_ns)
    h.air_told = 1 if math.isfinite(temperature) else 0
    air = temperature + ZERO_CELSIUS if h.air_told == 1 else STANDARD_AIR
    log_p = math.log(pressure)
    if h.fed == 0:
        h.fed, h.running, h.level = 1, 1, log_p
        h.P[2, 2], h.P[0, 2], h.P[2, 0] = h.P[0, 0] + NOISE_STD**2, -h.P[0, 0], -h.P[0, 0]
        h.x[2] = -h.x[0]
    h.pressure_ns = max(t_ns, h.pressure_ns)
    _refer(h, air)
    return _update(h, t_ns, K * air * (h.level - log_p))


@njit(cache=True, nogil=True)
def height_at(h: Height, t_ns: int, node: Node) -> None:
    """Put the height at this time into the node: nothing where it is as told."""
    if h.running == 0 or h.motion == REFERENCE:
        return
    _predict_to(h, t_ns)
    air_std = TOLD_AIR_STD if h.air_told == 1 else AIR_STD
    scale = air_std / STANDARD_AIR * (h.x[0] - h.told) if h.fed == 1 else 0.0
    node.height = h.x[0]
    late = LATE_STD * h.x[1] if h.fed == 1 else 0.0
    node.height_std = math.sqrt(h.P[0, 0] + h.doubt * h.doubt + scale * scale + late * late)
    node.height_source = BY_PRESSURE if h.fed == 1 else UNKNOWN


@njit(cache=True, nogil=True)
def share_references(heights: Array, rows: Array) -> None:
    """Let these rows see their references as they are now, so that the order of rows in a batch makes no difference."""
    for row in rows:
        h = heights[row]
        h.shared_ns = 0
        if 0 <= h.reference < len(heights):
            reference = heights[h.reference]
            if reference.motion == REFERENCE and reference.fed == 1:
                h.shared_ns, h.shared_var = reference.pressure_ns, reference.P[2, 2]
                h.shared_level = reference.level - (reference.x[2] + reference.told) / (K * STANDARD_AIR)


@njit(nogil=True)
def _refer(h: Height, air: float) -> None:
    """Let y count from the reference: at its first pressure y and b change alike. Without it the last one holds."""
    if h.motion == REFERENCE or h.shared_ns == 0:
        return
    if h.referred == 0:
        h.referred = 1
        h.x[2] += K * air * (h.shared_level - h.level)
        h.P[2, 2] += h.shared_var
    h.level, h.reference_ns = h.shared_level, h.shared_ns


@njit(nogil=True)
def _predict_to(h: Height, t_ns: int) -> None:
    """Predict to this time. What is older than the state leaves it as it is."""
    if h.t_ns == 0 or h.running == 0:
        h.t_ns = max(h.t_ns, t_ns)
        return
    left = (t_ns - h.t_ns) * 1e-9
    if left <= 0.0:
        return
    h.t_ns = t_ns
    referred = h.referred == 1 and (t_ns - h.reference_ns) * 1e-9 < REFERENCE_S
    h.P[2, 2] += (DRIFT_REFERRED if referred else DRIFT) * left
    if h.motion == REFERENCE:
        return
    left = min(left, FORGOTTEN_S)
    steps = int(left / MAX_STEP_S) + 1
    for _ in range(steps):
        _predict(h, left / steps)


@njit(nogil=True)
def _predict(h: Height, dt: float) -> None:
    """Predict height and vertical speed by a short time, s."""
    x, P = h.x, h.P
    a = math.exp(-dt / SPEED_TAU)
    along = SPEED_TAU * (1.0 - a)
    q = 2.0 * SPEED_STD**2 / SPEED_TAU
    x[0] += along * x[1]
    x[1] *= a
    P[0, 0] += along * (2.0 * P[0, 1] + along * P[1, 1]) + q * dt**3 / 3.0
    P[0, 1] = a * (P[0, 1] + along * P[1, 1]) + q * dt**2 / 2.0
    P[0, 2] += along * P[1, 2]
    P[1, 1] = a * a * P[1, 1] + SPEED_STD**2 * (1.0 - a * a)
    P[1, 2] *= a
    if P[0, 0] > HEIGHT_BOUND**2:
        shrink = HEIGHT_BOUND / math.sqrt(P[0, 0])
        P[0, 0], P[0, 1], P[0, 2] = HEIGHT_BOUND**2, shrink * P[0, 1], shrink * P[0, 2]
    P[1, 0], P[2, 0], P[2, 1] = P[0, 1], P[0, 2], P[1, 2]


@njit(nogil=True)
def _update(h: Height, t_ns: int, y: float) -> int:
    """Update with y = z + b, unless it is in doubt. What has jumped may be of z or b; of a reference, it is of b."""
    x, P = h.x, h.P
    e = y - x[0] - x[2]
    S = P[0, 0] + 2.0 * P[0, 2] + P[2, 2] + NOISE_STD**2
    if e * e > JUMP_GATE * JUMP_GATE * S:
        if h.doubt == 0.0:
            h.doubt_ns = t_ns
        h.doubt = e
        if (t_ns - h.doubt_ns) * 1e-9 < DOUBT_S:
            return DOUBTED
    if h.doubt != 0.0:
        of_height = 0.0 if h.motion == REFERENCE else e * e
        P[0, 0] += of_height
        P[2, 2] += e * e
        S += of_height + e * e
    h.doubt = 0.0
    g0, g1, g2 = (P[0, 0] + P[0, 2]) / S, (P[1, 0] + P[1, 2]) / S, (P[2, 0] + P[2, 2]) / S
    for i, g in ((0, g0), (1, g1), (2, g2)):
        x[i] += g * e
        for j, other in ((0, g0), (1, g1), (2, g2)):
            P[i, j] -= g * other * S
    return ACCEPTED

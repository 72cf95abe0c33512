"""What the IMU tells the smoother of one node: heading, speed, gyroscope bias and steps, as in the filter."""

from typing import Final

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.carried import predict_step_speed, step_speed_variance
from dropanchor_service.estimation.fleet.belief.heading_models import class_reference_error
from dropanchor_service.estimation.fleet.belief.lateral import (
    BOUND,
    is_lateral_known,
    lateral_residual,
    lateral_variance,
)
from dropanchor_service.estimation.fleet.belief.layout import (
    EXACT,
    GYRO_BIAS,
    PLATFORM_MODEL,
    REFERENCE,
    YAW,
    Floats,
    N,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.belief.rigidity import slip_std_of, tells_course
from dropanchor_service.estimation.fleet.belief.start import uses_heading
from dropanchor_service.estimation.fleet.belief.update import project, pseudo_measurement_variance, update_pda
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, RESTING, Node
from dropanchor_service.estimation.fleet.smoother.track import Track
from dropanchor_service.estimation.fleet.tuning import Tuning

BOUND_STD: Final = 0.05  # m/s, softness of the bounds on the speed
BACKWARDS: Final = 0.2  # m/s


@njit(nogil=True)
def measure(track: Track, k: int, H: Floats, e: float, variance: float) -> None:
    """Fuse z = h + noise; e = z - h(reference), H = dh/dx there."""
    m, P, n = track.mean[k], track.cov[k], track.used[k]
    PH = track.PH[k, n]
    S = project(P, H, PH) + variance
    for i in range(N):
        e -= H[i] * (m[i] - track.reference[k, i])
    track.H[k, n], track.S[k, n], track.e[k, n] = H, S, e
    track.used[k] += 1
    update_pda(m, P, PH, S, e, 1.0)


@njit(nogil=True)
def _component(track: Track, k: int, index: int, z: float, variance: float, H: Floats) -> None:
    H[:] = 0.0
    H[index] = 1.0
    measure(track, k, H, z - track.reference[k, index], variance)


@njit(nogil=True)
def update_inertial(track: Track, k: int, node: Node, row: Row, heading_class: int, t: Tuning, H: Floats) -> None:
    """Fuse heading, sideways acceleration, standstill and the bounds on the speed."""
    s = track.reference[k]
    if is_lateral_known(node) and tells_course(row):
        e = -lateral_residual(s, node, H)
        measure(track, k, H, e, max(lateral_variance(s, node, row, slip_std_of(row)), e * e / BOUND**2))
    if uses_heading(row, node) and (row.heading.model != PLATFORM_MODEL or heading_class == EXACT):
        white, _, _ = class_reference_error(row, heading_class, node.heading_var, t)
        H[:] = 0.0
        H[YAW] = H[REFERENCE] = 1.0
        measure(track, k, H, wrap(node.heading - row.heading.north - s[YAW] - s[REFERENCE]), white)
    if node.rest == RESTING:
        _component(track, k, V, 0.0, t.rest_std**2, H)
    elif node.step_speed > 0.0:
        e = node.step_speed - predict_step_speed(s, H)
        measure(track, k, H, e, step_speed_variance(node.step_speed, t))
    elif node.stands == 1:
        _component(track, k, V, 0.0, t.stand_std**2, H)
    if node.carried == 1:
        _bound_speed(track, k, row, t, H)
        return
    if node.rest == RESTING and node.gyro_bias_var > 0.0:
        prior = track.cov[k, GYRO_BIAS, GYRO_BIAS]
        if prior > 1.001 * node.gyro_bias_var:
            _component(track, k, GYRO_BIAS, 0.0, pseudo_measurement_variance(prior, node), H)
    elif node.rest != MOVING and node.dt_s > 0.0:
        variance = node.dyaw_var / node.dt_s**2 + t.rest_gyro_std**2
        _component(track, k, GYRO_BIAS, node.dyaw / node.dt_s, variance, H)
    _bound_speed(track, k, row, t, H)


@njit(nogil=True)
def _bound_speed(track: Track, k: int, row: Row, t: Tuning, H: Floats) -> None:
    s = track.reference[k]
    backwards = s[V] < -BACKWARDS or row.settings.reverse_allowed == 1  # the filter has decided that it drives so
    low = -row.settings.speed_max if backwards else -t.reverse_slack
    if s[V] < low:
        _component(track, k, V, low, BOUND_STD**2, H)
    elif s[V] > row.settings.speed_max:
        _component(track, k, V, row.settings.speed_max, BOUND_STD**2, H)

"""A smooth ride that does not turn does not tilt the tag either: what its gyroscope reads about level axes is bias.

No rest may tell it: an accelerometer as noisy as motion hides one, and some tags are switched on while they roll. With
the tilt error e and the bias error b about any level axis, whose covariance P is in `attitude`, the rate r is

    r = b + n,   K = (P_eb, P_bb)^T / (P_bb + q / dt),   P <- P - K (P_eb, P_bb)

where n is white noise of density q, because a floor is not even. The innovation is bounded: a ramp is no bias.
"""

import math

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.attitude import Attitude, rotate_by, up_in_body
from dropanchor_service.estimation.fleet.frontend.standstill import TAU, Standstill

UNEVEN = 3e-5  # rad^2/s, q
SMOOTH = 1e-4  # (rad/s)^2, variance of the rates, summed over the axes, above which a ride is not smooth
TURNING = 0.1  # rad/s, about the vertical, above which a wrong tilt shows as a rate about a level axis
TILTING = 0.05  # rad/s, about a level axis, that no bias is
BOUND, SLACK = 3.0, 0.005  # standard deviations of the bias, and rad/s beside, that an innovation counts at most


@njit(cache=True, nogil=True)
def learn_from_level_ride(a: Attitude, s: Standstill, dt: float, gyro: Array) -> None:
    """Update tilt and bias with rates, rad/s, unless they or their variance in the detector tell of another ride."""
    if s.seen <= TAU or s.gyro_bias_var > SMOOTH or dt == 0.0:
        return
    ux, uy, uz = up_in_body(a.q)
    x, y, z = gyro[0] - a.bias[0], gyro[1] - a.bias[1], gyro[2] - a.bias[2]
    yaw_rate = x * ux + y * uy + z * uz
    x, y, z = x - yaw_rate * ux, y - yaw_rate * uy, z - yaw_rate * uz
    size = math.sqrt(x * x + y * y + z * z)
    if abs(yaw_rate) > TURNING or size > TILTING:
        return
    P = a.tilt_cov
    cov, var = P[1], P[2]
    S = var + UNEVEN / dt
    bound = BOUND * math.sqrt(var) + SLACK
    scale = bound / max(size, bound)
    tilt, bias = scale * cov / S, scale * var / S
    rotate_by(a.q, -tilt * x, -tilt * y, -tilt * z)
    a.bias[0] += bias * x
    a.bias[1] += bias * y
    a.bias[2] += bias * z
    P[0] -= cov * cov / S
    P[1] -= cov * var / S
    P[2] -= var * var / S

"""A heading: the yaw of the body with the error of its reference.

How wrong the reference is, which gives the variance, is in `heading_models`; what else a heading decides of a row is in
`heading_update`.
"""

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import REFERENCE, YAW, Hypothesis, N, Scratch
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.measurement.scalar import update_pda


@njit(nogil=True)
def update_heading(one: Hypothesis, scratch: Scratch, z: float, variance: float) -> None:
    """Update one hypothesis with a heading, rad: z = yaw + error of the reference."""
    s, P, PH = one.mean, one.cov, scratch.PH
    for i in range(N):
        PH[i] = P[YAW, i] + P[REFERENCE, i]
    e = wrap(z - s[YAW] - s[REFERENCE])
    S = PH[YAW] + PH[REFERENCE] + variance
    update_pda(s, P, PH, S, e, 1.0)

"""What the uncertainty of a published place is made of, so that one knows what would shrink it.

Ranges fix the distance from the anchor, so their part, and that of the height, lie along the line to it. All else is an
error of the bearing phi, which goes with errors of north, of the mounting angle and of the speed. With C the covariance
of (yaw, mount + slip, v, phi) of the whole mixture and C = L Lᵀ, var(phi) is the sum of the squares of the last row of
L. Each of them is what knowing one more of the three would take away. The last one is an error of the bearing alone, as
after a start somewhere on a ring.
"""

import math

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import (
    MOUNT,
    PHI,
    SLIP,
    YAW,
    Anchor,
    Belief,
    Floats,
    Hypothesis,
    R,
    Row,
    Scratch,
    V,
)
from dropanchor_service.estimation.fleet.compiled import njit

NORTH, MOUNTING, SPEED, BEARING, RANGES, HEIGHT = range(6)  # of the parts; the first four are the order of C


@njit(nogil=True)
def forget_causes(scratch: Scratch) -> None:
    """Start the moments of a mixture."""
    scratch.causes[:] = 0.0
    scratch.radial[:] = 0.0


@njit(nogil=True)
def add_causes(one: Hypothesis, w: float, scratch: Scratch) -> None:
    """Add w times the moments of a hypothesis about scratch.mean: C, and the first and second of the distance."""
    s, P, mean, causes = one.mean, one.cov, scratch.mean, scratch.causes
    d_yaw, d_phi = wrap(s[YAW] - mean[4]), wrap(s[PHI] - math.atan2(mean[1], mean[0]))
    d_mount, d_v = wrap(s[MOUNT] + s[SLIP] - mean[2] + mean[4]), s[V] - mean[3]
    causes[0, 0] += w * (P[YAW, YAW] + d_yaw * d_yaw)
    causes[1, 0] += w * (P[MOUNT, YAW] + P[SLIP, YAW] + d_mount * d_yaw)
    causes[1, 1] += w * (P[MOUNT, MOUNT] + 2.0 * P[MOUNT, SLIP] + P[SLIP, SLIP] + d_mount * d_mount)
    causes[2, 0] += w * (P[V, YAW] + d_v * d_yaw)
    causes[2, 1] += w * (P[V, MOUNT] + P[V, SLIP] + d_v * d_mount)
    causes[2, 2] += w * (P[V, V] + d_v * d_v)
    causes[3, 0] += w * (P[PHI, YAW] + d_phi * d_yaw)
    causes[3, 1] += w * (P[PHI, MOUNT] + P[PHI, SLIP] + d_phi * d_mount)
    causes[3, 2] += w * (P[PHI, V] + d_phi * d_v)
    causes[3, 3] += w * (P[PHI, PHI] + d_phi * d_phi)
    scratch.radial[0] += w * s[R]
    scratch.radial[1] += w * (P[R, R] + s[R] ** 2)


@njit(nogil=True)
def turn_causes(scratch: Scratch, variance: float) -> None:
    """Add a rotation of everything about the anchor, rad^2."""
    scratch.causes[0, 0] += variance
    scratch.causes[3, 0] += variance
    scratch.causes[3, 3] += variance


@njit(nogil=True)
def fill_parts(row: Row, anchor: Anchor, scratch: Scratch, belief: Belief) -> None:
    """Fill belief.parts, m. Their squares add up to that of belief.sigma_pos."""
    parts, whole = belief.parts, belief.sigma_pos**2
    settings, r = row.settings, max(scratch.radial[0], 1e-3)
    along = min(max(scratch.radial[1] - scratch.radial[0] ** 2, 0.0), whole)
    dz, P = settings.height - anchor.z, settings.height_std**2
    height = min((dz * dz * P + P * P / 2.0) / (r * r), along)
    parts[RANGES], parts[HEIGHT] = math.sqrt(along - height), math.sqrt(height)
    _factorise(scratch.causes)
    last = scratch.causes[BEARING]
    of_bearing = max(last[0] ** 2 + last[1] ** 2 + last[2] ** 2 + last[3] ** 2, 1e-12)
    for k in range(BEARING + 1):
        parts[k] = math.sqrt(last[k] ** 2 / of_bearing * (whole - along))


@njit(nogil=True)
def _factorise(C: Floats) -> None:
    """Replace the lower half of C by L of C = L Lᵀ. What has no variance of its own explains nothing."""
    for i in range(len(C)):
        for j in range(i + 1):
            rest = C[i, j]
            for k in range(j):
                rest -= C[i, k] * C[j, k]
            if i == j:
                C[i, i] = math.sqrt(rest) if rest > 1e-12 else 0.0
            else:
                C[i, j] = rest / C[j, j] if C[j, j] > 0.0 else 0.0

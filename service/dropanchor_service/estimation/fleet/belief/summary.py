"""From the Gaussian sum to what is published: the heaviest mode's mean and covariance, its weight, observability."""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief.layout import CRAB, MOUNT, PHI, YAW, R, V
from dropanchor_service.estimation.fleet.belief.mixture import angle_variance, best_of
from dropanchor_service.estimation.fleet.belief.update import wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def planar(s: Any, P: Any, out: Any) -> None:
    """out (3, 3): covariance of (x, y, course) from the polar covariance."""
    planar_towards(math.cos(s[PHI]), math.sin(s[PHI]), s[R], P, out)


@njit(nogil=True)
def planar_towards(c: float, sn: float, r: float, P: Any, out: Any) -> None:
    """`planar` of a tag in the direction (c, sn) at distance r."""
    prr, ppp, prp = P[R, R], P[PHI, PHI], P[R, PHI]
    out[0, 0] = c * c * prr - 2 * c * sn * r * prp + sn * sn * r * r * ppp
    out[1, 1] = sn * sn * prr + 2 * c * sn * r * prp + c * c * r * r * ppp
    out[0, 1] = c * sn * prr + (c * c - sn * sn) * r * prp - c * sn * r * r * ppp
    rk = P[R, YAW] + P[R, MOUNT] + P[R, CRAB]
    pk = P[PHI, YAW] + P[PHI, MOUNT] + P[PHI, CRAB]
    out[0, 2] = c * rk - sn * r * pk
    out[1, 2] = sn * rk + c * r * pk
    out[2, 2] = P[YAW, YAW] + P[MOUNT, MOUNT] + P[CRAB, CRAB]
    out[2, 2] += 2 * (P[YAW, MOUNT] + P[YAW, CRAB] + P[MOUNT, CRAB])
    out[1, 0], out[2, 0], out[2, 1] = out[0, 1], out[0, 2], out[1, 2]
    bend(out, r, c, sn, ppp)


@njit(nogil=True)
def bend(cov: Any, r: float, c: float, s: float, variance: float) -> None:
    """An arc is not its tangent: a bearing error e moves the tag r e^2/2 inwards; add (1.5 r variance)^2 radially.

    The factor keeps a two-sigma bearing error inside the 95 % ellipse.
    """
    radial = (1.5 * r * variance) ** 2
    cov[0, 0] += c * c * radial
    cov[0, 1] += c * s * radial
    cov[1, 0] = cov[0, 1]
    cov[1, 1] += s * s * radial


@njit(nogil=True)
def add_reference(cov: Any, x: float, y: float, variance: float) -> None:
    """A heading reference wrong by an unknown constant turns everything about the anchor: error r * bias."""
    cov[0, 0] += variance * y * y
    cov[1, 1] += variance * x * x
    cov[0, 1] -= variance * x * y
    cov[0, 2] -= variance * y
    cov[1, 2] += variance * x
    cov[2, 2] += variance
    cov[1, 0], cov[2, 0], cov[2, 1] = cov[0, 1], cov[0, 2], cov[1, 2]
    r = max(math.hypot(x, y), 1e-6)
    bend(cov, r, x / r, y / r, variance)


@njit(nogil=True)
def course_of(s: Any) -> float:
    """Direction of travel, rad."""
    return wrap(s[YAW] + s[MOUNT] + s[CRAB])


@njit(nogil=True)
def locate(work: Any, count: int) -> None:
    """Where every hypothesis is, and how sure of it, for all that follows. Weights must be normalised."""
    for h in range(count):
        one = work[h]
        s, P = one.mean, one.cov
        one.weight = math.exp(one.log_weight)
        one.direction[0], one.direction[1] = math.cos(s[PHI]), math.sin(s[PHI])
        one.place[0], one.place[1] = s[R] * one.direction[0], s[R] * one.direction[1]
        one.spread = max(P[R, R] + s[R] ** 2 * min(angle_variance(P), P[PHI, PHI]), 0.0)


@njit(nogil=True)
def apart(a: Any, b: Any) -> bool:
    """Whether two hypotheses are two places: further from each other than 1 m + 2 sigma of both."""
    dx, dy = b.place[0] - a.place[0], b.place[1] - a.place[1]
    return bool(dx * dx + dy * dy > (1.0 + 2.0 * math.sqrt(a.spread + b.spread)) ** 2)


@njit(nogil=True)
def cluster(work: Any, count: int, head: int) -> float:
    """Mark the members of head's mode that are not taken; returns their weight."""
    weight = 0.0
    for h in range(count):
        work[h].member = not work[h].taken and not apart(work[head], work[h])
        if work[h].member:
            weight += work[h].weight
    return weight


@njit(nogil=True)
def moments(work: Any, count: int, head: int, scratch: Any) -> float:
    """Mean (x, y, course, speed, yaw) and covariance (x, y, course) of the members; returns their relative sigma."""
    mean, cov = scratch.mean, scratch.cov
    total, spread = 0.0, 0.0
    mean[:] = 0.0
    cov[:] = 0.0
    first = work[head]
    x0, y0, course0, yaw0 = first.place[0], first.place[1], course_of(first.mean), first.mean[YAW]
    for h in range(count):
        one = work[h]
        if one.member:
            w, s = one.weight, one.mean
            _add_moments(one, w, x0, y0, course0, scratch)
            mean[3] += w * s[V]
            mean[4] += w * wrap(s[YAW] - yaw0)
            spread += w * (one.spread + _from_head(first.mean, s))
            total += w
    for i in range(5):
        mean[i] /= total
    for i in range(3):
        for j in range(3):
            cov[i, j] = cov[i, j] / total - mean[i] * mean[j]
    mean[0] += x0
    mean[1] += y0
    mean[2] = wrap(mean[2] + course0)
    mean[4] = wrap(mean[4] + yaw0)
    return math.sqrt(spread / total)


@njit(nogil=True)
def _add_moments(one: Any, w: float, x0: float, y0: float, course0: float, scratch: Any) -> None:
    """Add w times the first and second moments of a hypothesis about (x0, y0, course0)."""
    mean, cov, part, point = scratch.mean, scratch.cov, scratch.part, scratch.point
    point[0], point[1] = one.place[0] - x0, one.place[1] - y0
    point[2] = wrap(course_of(one.mean) - course0)
    planar_towards(one.direction[0], one.direction[1], one.mean[R], one.cov, part)
    for i in range(3):
        mean[i] += w * point[i]
        for j in range(3):
            cov[i, j] += w * (part[i, j] + point[i] * point[j])


@njit(nogil=True)
def _from_head(head: Any, s: Any) -> float:
    """Squared distance, m^2, but for a rotation of everything about the anchor."""
    bearing = wrap(s[PHI] - head[PHI])
    angle = wrap(s[YAW] + s[MOUNT] - head[YAW] - head[MOUNT] - bearing)
    return float((s[R] - head[R]) ** 2 + head[R] ** 2 * min(bearing * bearing, angle * angle))


@njit(nogil=True)
def spread_over_all(work: Any, count: int, scratch: Any) -> None:
    """scratch.cov becomes that of all hypotheses about scratch.mean: an ellipse that other modes lie in, too."""
    mean, cov = scratch.mean, scratch.cov
    x, y, course = mean[0], mean[1], mean[2]
    cov[:] = 0.0
    for h in range(count):
        _add_moments(work[h], work[h].weight, x, y, course, scratch)
    mean[0], mean[1], mean[2] = x, y, course


@njit(nogil=True)
def _counts(one: Any, head: Any) -> bool:
    """Of the head's own class only the members of its mode count, of the others all."""
    return bool(one.member or one.kind != head.kind)


@njit(nogil=True)
def spread_over_classes(work: Any, count: int, head: int, scratch: Any, refuted: float) -> None:
    """scratch.cov becomes the mean over the classes that are not refuted, whatever their odds, about scratch.mean.

    Whether a reference is exact is seen late: until then an ellipse must not rest on the prior that it mostly is.
    """
    mean, share = scratch.mean, scratch.share
    x, y, course = mean[0], mean[1], mean[2]
    share[:] = 0.0
    scratch.cov[:] = 0.0
    for h in range(count):
        if _counts(work[h], work[head]):
            share[work[h].kind] += work[h].weight
    classes = 0
    for kind in range(3):
        classes += share[kind] > refuted
    for h in range(count):
        of_class = share[work[h].kind]
        if of_class > refuted and _counts(work[h], work[head]):
            _add_moments(work[h], work[h].weight / (of_class * classes), x, y, course, scratch)
    mean[0], mean[1], mean[2] = x, y, course


@njit(nogil=True)
def forget_information(J: Any, course: float, dt: float, q: float, t: Tuning) -> None:
    """J <- e^(-dt/W) A^-T J A^-1 for p += v u dt, then lose speed information: J -= J e_v e_v^T J q/(1 + q J_vv)."""
    c, s = math.cos(course) * dt, math.sin(course) * dt
    for j in range(3):
        J[2, j] -= c * J[0, j] + s * J[1, j]
    for i in range(3):
        J[i, 2] -= c * J[i, 0] + s * J[i, 1]
    keep = math.exp(-dt / t.obs_window)
    loss = q * dt / (1.0 + q * dt * keep * J[2, 2])
    v0, v1, v2 = J[0, 2] * keep, J[1, 2] * keep, J[2, 2] * keep
    for i in range(3):
        for j in range(3):
            J[i, j] *= keep
    J[0, 0] -= v0 * v0 * loss
    J[0, 1] -= v0 * v1 * loss
    J[0, 2] -= v0 * v2 * loss
    J[1, 1] -= v1 * v1 * loss
    J[1, 2] -= v1 * v2 * loss
    J[2, 2] -= v2 * v2 * loss
    J[1, 0], J[2, 0], J[2, 1] = J[0, 1], J[0, 2], J[1, 2]


@njit(nogil=True)
def sigma_obs(J: Any) -> float:
    """sqrt(lambda_max(J^-1)_xy), inf where the ranges of the window alone do not fix a position."""
    if J[2, 2] <= 0.0:
        return math.inf
    a = J[0, 0] - J[0, 2] ** 2 / J[2, 2]  # Schur complement: information on (x, y) alone
    b = J[0, 1] - J[0, 2] * J[1, 2] / J[2, 2]
    d = J[1, 1] - J[1, 2] ** 2 / J[2, 2]
    smallest = 0.5 * (a + d) - math.sqrt(0.25 * (a - d) ** 2 + b * b)
    if smallest < 1e-6:
        return math.inf
    return 1.0 / math.sqrt(smallest)


@njit(nogil=True)
def stay(work: Any, count: int, x: float, y: float, loyalty: float) -> int:
    """The heaviest hypothesis, but one near (x, y) if it is not lighter by more than `loyalty`.

    Of two mirrored modes of equal weight the one that was published last stays, rather than both in turn.
    """
    head = best_of(work, count)
    near = -1
    for h in range(count):
        dx, dy = work[h].place[0] - x, work[h].place[1] - y
        close = dx * dx + dy * dy <= (1.0 + 2.0 * math.sqrt(work[h].spread)) ** 2
        if close and (near < 0 or work[h].log_weight > work[near].log_weight):
            near = h
    if near >= 0 and work[near].log_weight > work[head].log_weight - loyalty:
        return near
    return head


@njit(nogil=True)
def best_mode(work: Any, count: int, row: Any, scratch: Any, t: Tuning) -> tuple[float, float, int]:
    """(p_mode, relative sigma, head) of the mode that is published."""
    locate(work, count)
    head = stay(work, count, row.last_x, row.last_y, t.loyalty)
    for h in range(count):
        work[h].taken = False
    weight = cluster(work, count, head)
    sigma = moments(work, count, head, scratch)
    row.last_x, row.last_y = scratch.mean[0], scratch.mean[1]
    return weight, sigma, head

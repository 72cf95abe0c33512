"""From the Gaussian mixture to what is published: mean, covariance and weight of the heaviest mode."""

import math

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.heading_models import reference_std
from dropanchor_service.estimation.fleet.belief.layout import (
    CLASSES,
    FAMILIES,
    MOUNT,
    PHI,
    SLIP,
    YAW,
    Floats,
    Hypotheses,
    Hypothesis,
    R,
    Row,
    Scratch,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import angle_variance, best_of, is_mounted_otherwise
from dropanchor_service.estimation.fleet.belief.parts import add_causes, forget_causes, turn_causes
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def planar_covariance(c: float, sn: float, r: float, P: Floats, out: Floats) -> None:
    """Fill out (3, 3) with the covariance of (x, y, course) of a tag in the direction (c, sn) at distance r."""
    prr, ppp, prp = P[R, R], P[PHI, PHI], P[R, PHI]
    out[0, 0] = c * c * prr - 2 * c * sn * r * prp + sn * sn * r * r * ppp
    out[1, 1] = sn * sn * prr + 2 * c * sn * r * prp + c * c * r * r * ppp
    out[0, 1] = c * sn * prr + (c * c - sn * sn) * r * prp - c * sn * r * r * ppp
    rk = P[R, YAW] + P[R, MOUNT] + P[R, SLIP]
    pk = P[PHI, YAW] + P[PHI, MOUNT] + P[PHI, SLIP]
    out[0, 2] = c * rk - sn * r * pk
    out[1, 2] = sn * rk + c * r * pk
    out[2, 2] = P[YAW, YAW] + P[MOUNT, MOUNT] + P[SLIP, SLIP]
    out[2, 2] += 2 * (P[YAW, MOUNT] + P[YAW, SLIP] + P[MOUNT, SLIP])
    out[1, 0], out[2, 0], out[2, 1] = out[0, 1], out[0, 2], out[1, 2]
    add_arc_curvature(out, r, c, sn, ppp)


@njit(nogil=True)
def add_arc_curvature(cov: Floats, r: float, c: float, s: float, variance: float) -> None:
    """Add the curvature of an arc: a bearing error e moves the tag r e^2/2 inwards, off the tangent.

    The factor 1.5 keeps a two-sigma bearing error inside the 95 % ellipse.
    """
    radial = (1.5 * r * variance) ** 2
    cov[0, 0] += c * c * radial
    cov[0, 1] += c * s * radial
    cov[1, 0] = cov[0, 1]
    cov[1, 1] += s * s * radial


@njit(cache=True, nogil=True)
def add_reference_variance(cov: Floats, x: float, y: float, variance: float) -> None:
    """Add a constant error of the heading reference, rad^2: it turns everything about the anchor."""
    cov[0, 0] += variance * y * y
    cov[1, 1] += variance * x * x
    cov[0, 1] -= variance * x * y
    cov[0, 2] -= variance * y
    cov[1, 2] += variance * x
    cov[2, 2] += variance
    cov[1, 0], cov[2, 0], cov[2, 1] = cov[0, 1], cov[0, 2], cov[1, 2]
    r = max(math.hypot(x, y), 1e-6)
    add_arc_curvature(cov, r, x / r, y / r, variance)


@njit(nogil=True)
def widen_by_reference(row: Row, scratch: Scratch) -> None:
    """Widen an ellipse of the site frame whose start was found: it is known only as well as the heading reference."""
    if row.start.known == 0 and row.heading.in_site_frame == 1:
        variance = reference_std(row) ** 2
        add_reference_variance(scratch.cov, scratch.mean[0], scratch.mean[1], variance)
        turn_causes(scratch, variance)


@njit(nogil=True)
def course_of(s: Floats) -> float:
    """Return the direction of travel, rad."""
    return wrap(s[YAW] + s[MOUNT] + s[SLIP])


@njit(nogil=True)
def fill_positions(work: Hypotheses, count: int) -> None:
    """Fill weight, direction, position and its variance of every hypothesis. Log weights must be normalised."""
    for h in range(count):
        one = work[h]
        s, P = one.mean, one.cov
        one.weight = math.exp(one.log_weight)
        one.direction[0], one.direction[1] = math.cos(s[PHI]), math.sin(s[PHI])
        one.position[0], one.position[1] = s[R] * one.direction[0], s[R] * one.direction[1]
        one.position_var = max(P[R, R] + s[R] ** 2 * min(angle_variance(P), P[PHI, PHI]), 0.0)


@njit(nogil=True)
def are_separate(a: Hypothesis, b: Hypothesis) -> bool:
    """Return whether two hypotheses are different places: further apart than 1 m + 2 sigma of both."""
    dx, dy = b.position[0] - a.position[0], b.position[1] - a.position[1]
    return bool(dx * dx + dy * dy > (1.0 + 2.0 * math.sqrt(a.position_var + b.position_var)) ** 2)


@njit(nogil=True)
def cluster(work: Hypotheses, count: int, head: int) -> float:
    """Mark the members of head's mode that belong to no mode yet. Return their weight."""
    weight = 0.0
    for h in range(count):
        work[h].in_mode = not work[h].assigned and not are_separate(work[head], work[h])
        if work[h].in_mode:
            weight += work[h].weight
    return weight


@njit(nogil=True)
def moments(work: Hypotheses, count: int, head: int, scratch: Scratch) -> float:
    """Fill scratch.mean (x, y, course, speed, yaw) and scratch.cov (x, y, course) of the mode.

    Return its sigma, m, without a common rotation about the anchor.
    """
    mean, cov = scratch.mean, scratch.cov
    total, spread = 0.0, 0.0
    mean[:] = 0.0
    cov[:] = 0.0
    first = work[head]
    x0, y0, course0, yaw0 = first.position[0], first.position[1], course_of(first.mean), first.mean[YAW]
    for h in range(count):
        one = work[h]
        if one.in_mode:
            w, s = one.weight, one.mean
            _add_spread(one, w, x0, y0, course0, scratch)
            for i in range(3):
                mean[i] += w * scratch.point[i]
            mean[3] += w * s[V]
            mean[4] += w * wrap(s[YAW] - yaw0)
            spread += w * (one.position_var + _from_head(first.mean, s))
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
def _add_spread(one: Hypothesis, w: float, x0: float, y0: float, course0: float, scratch: Scratch) -> None:
    """Add w times the second moments of a hypothesis about (x0, y0, course0) to scratch.cov. Set scratch.point."""
    cov, part, point = scratch.cov, scratch.part, scratch.point
    point[0], point[1] = one.position[0] - x0, one.position[1] - y0
    point[2] = wrap(course_of(one.mean) - course0)
    planar_covariance(one.direction[0], one.direction[1], one.mean[R], one.cov, part)
    for i in range(3):
        for j in range(3):
            cov[i, j] += w * (part[i, j] + point[i] * point[j])


@njit(nogil=True)
def _from_head(head: Floats, s: Floats) -> float:
    """Return the squared distance, m^2, without a common rotation about the anchor."""
    bearing = wrap(s[PHI] - head[PHI])
    angle = wrap(s[YAW] + s[MOUNT] - head[YAW] - head[MOUNT] - bearing)
    return float((s[R] - head[R]) ** 2 + head[R] ** 2 * min(bearing * bearing, angle * angle))


@njit(nogil=True)
def _forget_spread(scratch: Scratch) -> None:
    scratch.cov[:] = 0.0
    forget_causes(scratch)


@njit(nogil=True)
def _add_about_mean(one: Hypothesis, w: float, scratch: Scratch) -> None:
    """Add w times the second moments of a hypothesis about scratch.mean to scratch, and those of their causes."""
    mean = scratch.mean
    _add_spread(one, w, mean[0], mean[1], mean[2], scratch)
    add_causes(one, w, scratch)


@njit(nogil=True)
def spread_over_all(work: Hypotheses, count: int, scratch: Scratch) -> None:
    """Set scratch.cov to that of all hypotheses about scratch.mean: an ellipse that also holds the other modes."""
    _forget_spread(scratch)
    for h in range(count):
        _add_about_mean(work[h], work[h].weight, scratch)


@njit(nogil=True)
def _family(one: Hypothesis, head: Hypothesis) -> int:
    """Return the number of the heading class and the guess of the mounting angle that a hypothesis belongs to."""
    return int(one.heading_class + CLASSES * is_mounted_otherwise(one, head))


@njit(nogil=True)
def spread_over_families(work: Hypotheses, count: int, head: int, scratch: Scratch, rejected_weight: float) -> None:
    """Set scratch.cov to the mean over all families above `rejected_weight`, about scratch.mean.

    Each family counts the same. Ranges tell late whether a reference is exact, or whether a tag is mounted straight;
    until then an ellipse must not rest on the prior that it mostly is.
    """
    share = scratch.share
    share[:] = 0.0
    _forget_spread(scratch)
    for h in range(count):
        share[_family(work[h], work[head])] += work[h].weight
    families = 0
    for family in range(FAMILIES):
        families += share[family] > rejected_weight
    for h in range(count):
        of_family = share[_family(work[h], work[head])]
        if of_family > rejected_weight:
            _add_about_mean(work[h], work[h].weight / (of_family * families), scratch)


@njit(nogil=True)
def choose_head(work: Hypotheses, count: int, x: float, y: float, mode_hysteresis: float) -> int:
    """Return the heaviest hypothesis, or one near (x, y) that is lighter by no more than `mode_hysteresis`.

    Of two mirrored modes of equal weight the one that was published last is kept, rather than both in turn.
    """
    head = best_of(work, count)
    near = -1
    for h in range(count):
        dx, dy = work[h].position[0] - x, work[h].position[1] - y
        close = dx * dx + dy * dy <= (1.0 + 2.0 * math.sqrt(work[h].position_var)) ** 2
        if close and (near < 0 or work[h].log_weight > work[near].log_weight):
            near = h
    if near >= 0 and work[near].log_weight > work[head].log_weight - mode_hysteresis:
        return near
    return head


@njit(nogil=True)
def best_mode(work: Hypotheses, count: int, row: Row, scratch: Scratch, t: Tuning) -> tuple[float, float, int]:
    """Return (weight, sigma without a common rotation, index of the heaviest hypothesis) of the mode to publish."""
    fill_positions(work, count)
    head = choose_head(work, count, row.publication.x, row.publication.y, t.mode_hysteresis)
    for h in range(count):
        work[h].assigned = False
    weight = cluster(work, count, head)
    sigma = moments(work, count, head, scratch)
    row.publication.x, row.publication.y = scratch.mean[0], scratch.mean[1]
    return weight, sigma, head

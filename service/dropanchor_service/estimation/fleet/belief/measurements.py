"""Update all hypotheses of a row with a node's range, bearing, heading or standstill."""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.heading_classes import add_drift_class
from dropanchor_service.estimation.fleet.belief.heading_models import (
    class_reference_error,
    is_heading_std_given,
    model_parameters,
    predict_models,
    reference_error,
    reset_models,
    update_models,
)
from dropanchor_service.estimation.fleet.belief.heading_reference import (
    add_common_rotation,
    add_reference_error,
    adopt_reference,
    turn_to_yaw,
)
from dropanchor_service.estimation.fleet.belief.layout import (
    DRIFTING,
    EXACT,
    MAGNETOMETER_MODEL,
    PHI,
    PLATFORM_MODEL,
    SLIP,
    YAW,
    Anchor,
    Anchors,
    Belief,
    Hypotheses,
    R,
    Row,
    Scratch,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of
from dropanchor_service.estimation.fleet.belief.start import ADOPT_VAR, choose_model
from dropanchor_service.estimation.fleet.belief.update import (
    predict_range,
    truncate_speed,
    update_bearing,
    update_heading,
    update_range,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, MEASURED_HEADING, Node
from dropanchor_service.estimation.fleet.tuning import Tuning

ONE_SIDED: Final = 1.5  # standard deviations: an innovation beyond counts for a run of ranges too long or too short
MISFIT_GAIN: Final = 0.1  # weight of the newest range in the mean outlier probability
NEAREST: Final = 1e-3  # m


@njit(nogil=True)
def range_variance(row: Row, node: Node, anchor: Anchor) -> float:
    """Return the variance of a measured range, m^2: its noise, the tag's height, and a secondary anchor's bias.

    measured = scale * distance + bias, so an error dh of the height changes it by scale * dz / distance * dh.
    """
    settings = row.settings
    std = node.z_std if math.isfinite(node.z_std) and node.z_std > 0.0 else settings.range_std
    dz = settings.height - anchor.z
    distance = max((node.z - settings.range_bias) / settings.range_scale, 0.1)
    variance = std * std + (settings.range_scale * dz * settings.height_std / distance) ** 2
    if node.anchor != row.anchor:
        variance += settings.range_bias_std**2
    return float(variance)


@njit(nogil=True)
def update_with_range(
    work: Hypotheses, count: int, row: Row, node: Node, anchors: Anchors, t: Tuning, scratch: Scratch, belief: Belief
) -> None:
    """Update every hypothesis with the node's range. The belief gets the innovation of the heaviest one."""
    H, out, settings = scratch.H, scratch.out, row.settings
    anchor, primary = anchors[node.anchor], anchors[row.anchor]
    ox, oy, dz = anchor.x - primary.x, anchor.y - primary.y, settings.height - anchor.z
    clear = range_variance(row, node, anchor)
    power, p, mean, std = t.likelihood_power, t.outlier_probability, t.outlier_mean, t.outlier_std
    speed_max = settings.speed_max
    either = settings.reverse_allowed == 1 and not math.isfinite(node.dv_var)
    if node.carried == 1:
        clear *= t.walk_range_factor
        power, p, mean, std = (
            t.walk_likelihood_power,
            t.walk_outlier_probability,
            t.walk_outlier_mean,
            t.walk_outlier_std,
        )
        speed_max = min(speed_max, t.walk_speed_max)
    best = best_of(work, count)
    y, S, p_outlier = 0.0, 1.0, 0.0
    for h in range(count):
        s, P = work[h].mean, work[h].cov
        e = node.z - predict_range(s, ox, oy, dz, node.lag_s, settings.range_scale, settings.range_bias, H)
        variance = clear
        if math.isfinite(node.dv_var):
            variance += settings.range_scale**2 * t.bilinear * P[V, V] * P[SLIP, SLIP] * settings.slip_tau**2
        update_range(work[h], scratch, e, variance, p, mean, std, t)
        work[h].log_weight += power * out[0]
        if s[R] < 0.0:
            s[R] = NEAREST
        low = -settings.speed_max if either or work[h].reverse == 1 else -t.reverse_slack
        high = speed_max if either or work[h].reverse == 0 else t.reverse_slack
        work[h].log_weight += truncate_speed(s, P, scratch.PH, low, high)
        if h == best:
            y, S, p_outlier = e, out[1], out[2]
    _update_misfit(row, y, S, p_outlier)
    _record_innovation(belief, y, S, p_outlier)


@njit(nogil=True)
def update_with_bearing(
    work: Hypotheses, count: int, row: Row, node: Node, anchors: Anchors, t: Tuning, scratch: Scratch, belief: Belief
) -> None:
    """Update every hypothesis with the node's bearing."""
    anchor, primary, out = anchors[node.anchor], anchors[row.anchor], scratch.out
    ox, oy, variance = anchor.x - primary.x, anchor.y - primary.y, node.z_std**2
    best = best_of(work, count)
    for h in range(count):
        s, P = work[h].mean, work[h].cov
        likelihood = update_bearing(s, P, scratch.H, scratch.PH, ox, oy, node.z, variance, out)
        work[h].log_weight += t.likelihood_power * likelihood
        if h == best:
            _record_innovation(belief, out[0], out[1], out[2])


@njit(nogil=True)
def _record_innovation(belief: Belief, y: float, S: float, p_outlier: float) -> None:
    belief.innovation = y
    belief.innovation_variance = S
    belief.p_outlier = p_outlier


@njit(nogil=True)
def _update_misfit(row: Row, y: float, S: float, p_outlier: float) -> None:
    """Count how many ranges in a row are too long or too short, and average the outlier probability."""
    nlos = row.nlos
    nlos.high_run = nlos.high_run + 1 if y > ONE_SIDED * math.sqrt(S) else 0
    nlos.low_run = nlos.low_run + 1 if y < -ONE_SIDED * math.sqrt(S) else 0
    nlos.misfit += MISFIT_GAIN * (p_outlier - nlos.misfit)


@njit(nogil=True)
def update_with_heading(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Update the hypotheses with the node's heading. Return their count, which a change of model may raise."""
    if row.heading.in_site_frame == 0 and not _enter_site_frame(work, count, row, node, t):
        return count
    if node.heading_kind == MEASURED_HEADING:
        if not is_heading_std_given(row):
            count = _update_heading_model(work, count, row, node, t)
    elif (
        node.heading_kind == ABSOLUTE_HEADING
        and row.heading.model != MAGNETOMETER_MODEL
        and not _adopt_magnetic_heading(work, count, row, node)
    ):
        return count
    for h in range(count):
        if row.heading.model != PLATFORM_MODEL or work[h].heading_class == EXACT:
            white, _, _ = class_reference_error(row, work[h].heading_class, node.heading_var, t)
            update_heading(work[h], scratch, node.heading - row.heading.north, white)
    if row.heading.model == MAGNETOMETER_MODEL:
        _, slow, _ = reference_error(row, node.heading_var)
        row.heading.slow_var = slow * slow
    return count


@njit(nogil=True)
def _update_heading_model(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Choose the model of the heading error by the bank's predictions. A new model's slow error goes to all hypotheses.

    Return the count of hypotheses.
    """
    heading = row.heading
    if heading.bank_started == 0:
        reset_models(row, node.heading, node.heading_var, t)
        return count
    predict_models(row, node, node.heading_var, t)
    chosen = update_models(row, node, t)
    if chosen == heading.model:
        return count
    _, before, _ = model_parameters(heading.model, node.heading_var)
    _, after, _ = model_parameters(chosen, node.heading_var)
    heading.model = chosen
    count = add_drift_class(work, count, chosen, after, t)
    if after > before:
        for h in range(count):
            if work[h].heading_class != DRIFTING:
                add_reference_error(work[h].cov, math.sqrt(after * after - before * before), False)
    return count


@njit(nogil=True)
def _enter_site_frame(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> bool:
    """Turn a belief in a frame of the tag's own by the node's heading, if it is good enough. Return whether it was."""
    if node.heading_kind == ABSOLUTE_HEADING and node.heading_var > ADOPT_VAR:
        return False
    choose_model(row, node, t)
    std = math.sqrt(node.heading_var)
    for h in range(count):
        work[h].mean[PHI] += node.heading - work[h].mean[YAW]
        work[h].mean[YAW] = node.heading
        turn_to_yaw(work[h].cov)
        add_common_rotation(work[h].cov, std)
    row.heading.in_site_frame = 1
    return True


@njit(nogil=True)
def _adopt_magnetic_heading(work: Hypotheses, count: int, row: Row, node: Node) -> bool:
    """Let yaw count from the magnetometer from now on. Return whether that was done.

    With a given start heading the constant error of the magnetometer is not known: it is taken to agree with the yaw of
    now, and the error of that yaw becomes one of the mounting angle. That waits until the magnetometer is better than
    the yaw. Otherwise the hypotheses have headings all around, among which the magnetometer decides.
    """
    heading, best = row.heading, work[best_of(work, count)]
    if not math.isfinite(row.start.heading):
        heading.model = MAGNETOMETER_MODEL
        _, slow, _ = reference_error(row, node.heading_var)
        for h in range(count):
            add_reference_error(work[h].cov, slow, False)
        return True
    if node.heading_var > best.cov[YAW, YAW]:
        return False
    heading.model = MAGNETOMETER_MODEL
    heading.north = wrap(node.heading - best.mean[YAW])
    for h in range(count):
        adopt_reference(work[h].cov, node.heading_var)
    return True

"""Update all hypotheses of a row with a node's heading, which may change its model and its frame."""

import math

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.heading_models import (
    class_reference_error,
    is_heading_std_given,
    is_north_given,
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
    EXACT,
    MAGNETOMETER_MODEL,
    PHI,
    PLATFORM_MODEL,
    REFERENCE,
    YAW,
    Hypotheses,
    Hypothesis,
    N,
    Row,
    Scratch,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of
from dropanchor_service.estimation.fleet.belief.start import ADOPT_VAR, choose_model
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, MEASURED_HEADING, Node
from dropanchor_service.estimation.fleet.measurement.scalar import update_pda
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def update_heading(one: Hypothesis, scratch: Scratch, z: float, variance: float) -> None:
    """Update one hypothesis with a heading, rad: z = yaw + error of the reference."""
    s, P, PH = one.mean, one.cov, scratch.PH
    for i in range(N):
        PH[i] = P[YAW, i] + P[REFERENCE, i]
    e = wrap(z - s[YAW] - s[REFERENCE])
    S = PH[YAW] + PH[REFERENCE] + variance
    update_pda(s, P, PH, S, e, 1.0)


@njit(nogil=True)
def update_with_heading(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> None:
    """Update the hypotheses with the node's heading."""
    if row.heading.in_site_frame == 0 and not _enter_site_frame(work, count, row, node, t):
        return
    if node.heading_kind == MEASURED_HEADING:
        if not is_heading_std_given(row):
            _update_heading_model(work, count, row, node, t)
    elif (
        node.heading_kind == ABSOLUTE_HEADING
        and row.heading.model != MAGNETOMETER_MODEL
        and not _adopt_magnetic_heading(work, count, row, node)
    ):
        return
    for h in range(count):
        if row.heading.model != PLATFORM_MODEL or work[h].heading_class == EXACT:
            white, _, _ = class_reference_error(row, work[h].heading_class, node.heading_var, t)
            update_heading(work[h], scratch, node.heading - row.heading.north, white)
    if row.heading.model == MAGNETOMETER_MODEL:
        _, slow, _ = reference_error(row, node.heading_var)
        row.heading.slow_var = slow * slow


@njit(nogil=True)
def _update_heading_model(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> None:
    """Choose the model of the heading error by the predictions of both. Its slow error goes to all hypotheses."""
    heading = row.heading
    if heading.models_started == 0:
        reset_models(row, node.heading, node.heading_var)
        return
    predict_models(row, node, node.heading_var, t)
    chosen = update_models(row, node, t)
    if chosen == heading.model:
        return
    _, before, _ = model_parameters(heading.model, node.heading_var)
    _, after, _ = model_parameters(chosen, node.heading_var)
    heading.model = chosen
    if after > before:
        for h in range(count):
            add_reference_error(work[h].cov, math.sqrt(after * after - before * before), False)


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
    if not math.isfinite(row.start.heading) or is_north_given(row):
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

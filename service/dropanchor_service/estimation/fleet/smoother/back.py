"""Step smoothed hypotheses back over a node, by what the filter believed before it and by its motion model.

The recursion of Rauch, Tung and Striebel needs no measurement: what the later ones say is in the later belief. With the
filtered moments (x, P) of the hypothesis before the node, their prediction (x', P'), its covariance C = cov(x, x') and
the smoothed moments (y, S) after it,

    gain = C P'^-1        smoothed x + gain (y - x')        P + gain (S - P') gain^T

y - x' has the covariance P' - S where the two belong together. So (y - x')^T P'^-1 (y - x') is at most chi-square with
as many degrees of freedom as there are states; beyond CONTRADICTED the later belief does not continue the one before.
"""

import math
from typing import Any, Final

import numpy as np

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.heading_models import model_parameters, reference_error
from dropanchor_service.estimation.fleet.belief.heading_reference import (
    add_common_rotation,
    add_reference_error,
    adopt_reference,
    turn_to_yaw,
)
from dropanchor_service.estimation.fleet.belief.layout import (
    MAGNETOMETER_MODEL,
    MOUNT,
    PHI,
    PLATFORM_MODEL,
    RANGE_BIAS,
    REFERENCE,
    YAW,
    Floats,
    Hypothesis,
    N,
    R,
    Row,
    Scratch,
)
from dropanchor_service.estimation.fleet.belief.predict import (
    fill_class_noise,
    fill_noise,
    is_empty,
    predict,
    predict_state,
)
from dropanchor_service.estimation.fleet.belief.rigidity import RIGID_SLIP, slip_std_of
from dropanchor_service.estimation.fleet.belief.tilt import bends_tilt, follow_tilt, turn_columns
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning

CONTRADICTED: Final = 37.0  # chi-square of 11 degrees of freedom, exceeded once in 10,000
SINGULAR: Final = 1e-9  # share of a variance that the states before it leave, below which they tell it exactly

Trace = Any  # a record of TRACE


@njit(nogil=True, cache=True)
def set_row(row: Row, before: Trace, after: Trace) -> None:
    """Set what the motion model reads of a row to what it was when the node between two traces was predicted."""
    row.heading.model, row.heading.slow_var = before.model, before.slow_var
    row.mount.rigid = after.rigid


@njit(nogil=True)
def predict_mean(s: Floats, node: Node, scratch: Scratch, enters: bool) -> None:
    """Predict the state s. enters: the node's heading turned the belief into the site frame."""
    if not is_empty(node):
        predict_state(s, node, scratch.decay, scratch.F)
    if enters:
        s[PHI] += node.heading - s[YAW]
        s[YAW] = node.heading


@njit(nogil=True, cache=True)
def predict_moments(
    one: Hypothesis, child: Hypothesis, node: Node, row: Row, after: Trace, enters: bool, t: Tuning, scratch: Scratch
) -> tuple[Floats, Floats, Floats]:
    """Return the predicted mean and covariance of a hypothesis, and its covariance with its prediction."""
    decay, growth = scratch.decay, scratch.growth
    s, P, C = one.mean.copy(), one.cov.copy(), one.cov.copy()
    if not is_empty(node):
        rigid = slip_std_of(row) <= RIGID_SLIP
        bends = bends_tilt(node, rigid)
        fill_noise(decay, growth, node, row, t)
        fill_class_noise(decay, growth, node, row, one.heading_class, t)
        predict(s, P, scratch, node, row, t, one.nlos, False, rigid)
        _cross(one.cov, scratch.F, decay, C)
        if bends and rigid:
            turn_columns(C, s, node)
        if bends:
            follow_tilt(s, P, node, rigid, t)
    _follow_heading(s, P, C, node, row, after, enters)
    _follow_branches(s, P, one, child, node, t)
    return s, P, C


@njit(nogil=True)
def _cross(P: Floats, F: Floats, decay: Floats, C: Floats) -> None:
    """Fill C with P J^T, J = [F; diag(decay)]."""
    for i in range(N):
        for j in range(4):
            total = 0.0
            for m in range(N):
                total += F[j, m] * P[i, m]
            C[i, j] = total
        for j in range(4, N):
            C[i, j] = P[i, j] * decay[j]


@njit(nogil=True)
def _follow_heading(s: Floats, P: Floats, C: Floats, node: Node, row: Row, after: Trace, enters: bool) -> None:
    """Do to a prediction what the belief did when it took its north, or another model of it, from the node."""
    before = row.heading.model
    if enters:
        s[PHI] += node.heading - s[YAW]
        s[YAW] = node.heading
        turn_to_yaw(P)
        add_common_rotation(P, math.sqrt(node.heading_var))
        C[:, PHI] -= C[:, YAW]
        C[:, YAW] = 0.0
    elif after.model == MAGNETOMETER_MODEL and before != MAGNETOMETER_MODEL:
        if math.isfinite(row.start.heading):
            adopt_reference(P, node.heading_var)
            C[:, MOUNT] += C[:, YAW]
            C[:, YAW] = 0.0
            C[:, REFERENCE] = 0.0
        else:
            row.heading.model = after.model
            _, slow, _ = reference_error(row, node.heading_var)
            row.heading.model = before
            add_reference_error(P, slow, False)
    elif after.model != before and after.model != PLATFORM_MODEL:
        _, was, _ = model_parameters(before, node.heading_var)
        _, now, _ = model_parameters(after.model, node.heading_var)
        P[REFERENCE, REFERENCE] += max(now * now - was * was, 0.0)


@njit(nogil=True)
def _follow_branches(s: Floats, P: Floats, one: Hypothesis, child: Hypothesis, node: Node, t: Tuning) -> None:
    """Allow for what a hypothesis may have become at the node: one without a line of sight, or a device that turned."""
    if one.nlos != child.nlos:
        P[RANGE_BIAS, RANGE_BIAS] += t.outlier_mean**2 + t.outlier_std**2
    if node.carried == 1 and node.turned != 0.0:
        P[MOUNT, MOUNT] += node.turned**2
        P[R, R] += t.device_turn_var
        P[PHI, PHI] += t.device_turn_var / max(s[R], 1.0) ** 2


@njit(nogil=True, cache=True)
def step_back(mean: Floats, cov: Floats, one: Hypothesis, s: Floats, P: Floats, C: Floats) -> bool:
    """Step smoothed moments back to the hypothesis `one` before the node. Return whether they continue it.

    s, P, C: from `predict_moments`.
    """
    d = mean - s
    d[PHI], d[YAW] = wrap(d[PHI]), wrap(d[YAW])
    L = _factor(P)
    gain = np.empty((N, N))
    for i in range(N):
        _solve(L, P, C[i], gain[i])
    pull = np.empty(N)
    _solve(L, P, d, pull)
    distance = 0.0
    for i in range(N):
        distance += d[i] * pull[i]
    if not distance < CONTRADICTED:
        return False
    spare, part = cov - P, np.zeros((N, N))
    for i in range(N):
        mean[i] = one.mean[i]
        for j in range(N):
            mean[i] += gain[i, j] * d[j]
            for m in range(N):
                part[i, j] += gain[i, m] * spare[m, j]
    for i in range(N):
        for j in range(i, N):
            total = one.cov[i, j]
            for m in range(N):
                total += part[i, m] * gain[j, m]
            cov[i, j] = cov[j, i] = total
    return True


@njit(nogil=True)
def _factor(P: Floats) -> Any:
    """Return the Cholesky factor of the correlations in P. A state that those before it tell exactly has a zero row."""
    L = np.zeros((N, N))
    for i in range(N):
        if P[i, i] <= 0.0:
            continue
        left = 1.0
        for j in range(i):
            if L[j, j] > 0.0:
                total = P[i, j] / math.sqrt(P[i, i] * P[j, j])
                for m in range(j):
                    total -= L[i, m] * L[j, m]
                L[i, j] = total / L[j, j]
                left -= L[i, j] ** 2
        if left > SINGULAR:
            L[i, i] = math.sqrt(left)
        else:
            L[i, :] = 0.0
    return L


@njit(nogil=True)
def _solve(L: Floats, P: Floats, b: Floats, x: Floats) -> None:
    """Fill x with P^-1 b, 0 for the states that others tell."""
    for i in range(N):
        x[i] = 0.0
        if L[i, i] > 0.0:
            total = b[i] / math.sqrt(P[i, i])
            for m in range(i):
                total -= L[i, m] * x[m]
            x[i] = total / L[i, i]
    for i in range(N - 1, -1, -1):
        if L[i, i] > 0.0:
            total = x[i]
            for m in range(i + 1, N):
                total -= L[m, i] * x[m]
            x[i] = total / L[i, i]
    for i in range(N):
        if L[i, i] > 0.0:
            x[i] /= math.sqrt(P[i, i])

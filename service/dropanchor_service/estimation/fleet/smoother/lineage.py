"""The track of the surviving mode, traced back from the heaviest hypothesis of the last node.

The predecessor is the hypothesis of the node before whose prediction is closest to the later one. Where none is close,
the later one is moved back by dead reckoning. The iterated smoother starts from this track.
"""

import math

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import MOUNT, PHI, SLIP, YAW, Floats, N, R, V
from dropanchor_service.estimation.fleet.belief.predict import predict_state
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node, Nodes

MAX_DISTANCE = 25.0  # squared distance up to which a hypothesis is the one before
POSITION_VARIANCE = 0.25  # m^2, at most: one that is nowhere in particular is not the one before
OTHER_CLASS = 9.0  # added where the hypothesis has another model of the heading reference
SLACK = 0.01  # m^2, (m/s)^2
YAW_SLACK = 1e-4  # rad^2


@njit(nogil=True)
def distance(s: Floats, P: Floats, target: Floats) -> float:
    """Return the squared distance in position, speed and yaw, in variances."""
    dx = s[R] * math.cos(s[PHI]) - target[R] * math.cos(target[PHI])
    dy = s[R] * math.sin(s[PHI]) - target[R] * math.sin(target[PHI])
    spread = min(P[R, R] + s[R] ** 2 * P[PHI, PHI], POSITION_VARIANCE)
    dv, dyaw = s[V] - target[V], wrap(s[YAW] - target[YAW])
    return float(
        (dx * dx + dy * dy) / (spread + SLACK) + dv * dv / (P[V, V] + SLACK) + dyaw * dyaw / (P[YAW, YAW] + YAW_SLACK)
    )


@njit(nogil=True)
def step_back(s: Floats, node: Node, out: Floats) -> None:
    """Undo `predict_state` by dead reckoning. The other states stay."""
    out[:] = s
    m = s[MOUNT] + s[SLIP]
    f = node.dv_forward * math.cos(m) + node.dv_left * math.sin(m) if math.isfinite(node.dv_var) else 0.0
    out[V] = s[V] - f
    out[YAW] = s[YAW] - node.dyaw
    d = (out[V] + f / 2) * node.dt_s
    course = out[YAW] + node.dyaw / 2 + m
    c, sn = math.cos(out[YAW]), math.sin(out[YAW])
    x = s[R] * math.cos(s[PHI]) - d * math.cos(course) - node.swing_forward * c + node.swing_left * sn
    y = s[R] * math.sin(s[PHI]) - d * math.sin(course) - node.swing_forward * sn - node.swing_left * c
    out[R] = max(math.hypot(x, y), 1e-3)
    out[PHI] = math.atan2(y, x)


@njit(nogil=True)
def _unwrap_angles(reference: Floats, nodes: Nodes, decay: Floats) -> None:
    """Unwrap bearing and yaw of every node to the branch that the node before predicts."""
    F, s = np.zeros((4, N)), np.zeros(N)
    for k in range(1, len(nodes)):
        s[:] = reference[k - 1]
        predict_state(s, nodes[k], decay, F)
        for i in (PHI, YAW):
            reference[k, i] = s[i] + wrap(reference[k, i] - s[i])


@njit(nogil=True, cache=True)
def trace_lineage(nodes: Nodes, traces: Array, reference: Floats, nlos: Array) -> int:
    """Fill reference (n, N) and nlos (n,). Return the index of the first node's hypothesis, -1 for none."""
    F, s, decay = np.zeros((4, N)), np.zeros(N), np.ones(N)
    n = len(nodes)
    reference[n - 1] = traces[n - 1].mean[0]
    nlos[n - 1] = traces[n - 1].nlos[0]
    heading_class, chosen = traces[n - 1].heading_class[0], 0
    for k in range(n - 1, 0, -1):
        chosen, least = -1, MAX_DISTANCE
        for j in range(traces[k - 1].count):
            s[:] = traces[k - 1].mean[j]
            predict_state(s, nodes[k], decay, F)
            d2 = distance(s, traces[k - 1].cov[j], reference[k])
            if traces[k - 1].heading_class[j] != heading_class:
                d2 += OTHER_CLASS
            if d2 < least:
                chosen, least = j, d2
        if chosen >= 0:
            reference[k - 1] = traces[k - 1].mean[chosen]
            nlos[k - 1] = traces[k - 1].nlos[chosen]
        else:
            step_back(reference[k], nodes[k], reference[k - 1])
            nlos[k - 1] = nlos[k]
    _unwrap_angles(reference, nodes, decay)
    return chosen

"""Single hypotheses and nodes for tests of the pose belief, and derivatives by finite differences."""

from typing import Any

import numpy as np

from dropanchor_service.estimation.fleet.belief.layout import N
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.frontend.node import NODE

STATE = np.array([12.0, 0.7, -2.1, 1.4, 0.2, -0.05, 0.004, 0.08, 0.03, 0.12, -0.06])


def node_of(
    dt: float = 0.1, dyaw: float = 0.06, forward: float = 0.05, left: float = 0.08, swing: tuple[float, float] = (0, 0)
) -> Any:
    node = np.zeros((), NODE)
    node["swing_forward"], node["swing_left"] = swing
    node["dt_s"], node["dyaw"], node["dv_forward"], node["dv_left"], node["dv_var"] = dt, dyaw, forward, left, 1e-4
    return node.view(np.recarray)[()]


def hypothesis_of(mean: Any, cov: Any, jacobian: Any = 0.0) -> tuple[Any, Any]:
    """Return one hypothesis with this mean and covariance, and scratch with this Jacobian of a measurement."""
    space = make_workspace()[0]
    one, scratch = space["hypotheses"][0], space["scratch"]
    one["mean"], one["cov"], scratch["H"] = mean, cov, jacobian
    return one, scratch


def jacobian_fd(f: Any, s: Any) -> Any:
    columns = []
    for i in range(N):
        h = np.zeros(N)
        h[i] = 1e-6
        columns.append((f(s + h) - f(s - h)) / 2e-6)
    return np.array(columns).T

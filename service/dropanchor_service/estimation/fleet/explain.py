"""What the pose belief made of each range and bearing, for those who ask why."""

from typing import Any

import numpy as np

from dropanchor_service.estimation.batch import INNOVATION, Array, MeasurementKind

from .node import RANGE

REFUSED = 0.5  # probability of an outlier above which a measurement hardly moved the belief


def explained(nodes: Array, beliefs: Array, scale: Array) -> Any:
    """INNOVATION of the nodes (NODE) whose measurement met a running belief (BELIEF), in the units of the measurement.

    The belief compares ranges z / scale; here z = predicted + innovation holds for what was measured.
    """
    chosen = beliefs["innovation_variance"] > 0.0
    node, belief = nodes[chosen], beliefs[chosen]
    is_range = node["kind"] == RANGE
    unit = np.where(is_range, scale[chosen], 1.0)
    records = np.zeros(len(node), INNOVATION)
    for name in ("row", "t_ns", "anchor"):
        records[name] = node[name]
    records["kind"] = np.where(is_range, MeasurementKind.RANGE, MeasurementKind.BEARING)
    records["measured"] = node["z"]
    records["innovation"] = belief["innovation"] * unit
    records["predicted"] = records["measured"] - records["innovation"]
    records["S"] = belief["innovation_variance"] * unit**2
    records["p_outlier"] = belief["p_outlier"]
    records["fused"] = belief["p_outlier"] < REFUSED
    return records

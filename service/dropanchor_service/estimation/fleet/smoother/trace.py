"""What a smoother needs of a run of the engine: its nodes, and the heaviest hypotheses after each of them."""

from typing import Any, Final

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.layout import BELIEF, KEEP, N, with_room
from dropanchor_service.estimation.fleet.belief.mixture import put_in_order
from dropanchor_service.estimation.fleet.belief.pool import load
from dropanchor_service.estimation.fleet.belief.step import advance
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.frontend.node import NODE
from dropanchor_service.estimation.fleet.tuning import Tuning

KEPT: Final = 8  # hypotheses of a node

TRACE: Final = np.dtype(
    [
        ("count", np.int32),
        ("model", np.uint8),  # of the heading error, as in the row
        ("referred", np.uint8),
        ("north", np.float64),
        ("log_weight", np.float64, (KEPT,)),  # heaviest first
        ("kind", np.int32, (KEPT,)),
        ("blocked", np.int32, (KEPT,)),
        ("mean", np.float64, (KEPT, N)),
        ("cov", np.float64, (KEPT, N, N)),
    ]
)


class TracingEngine(FleetEngine):
    """The engine `fleet`, same poses to the last bit, that remembers all it did: for offline use."""

    def __init__(self, tuning: Tuning | None = None) -> None:
        super().__init__(tuning)
        self._steps: list[tuple[Array, Array, Array]] = []

    @property
    def tuning(self) -> Tuning:
        return self._tuning

    @property
    def anchors(self) -> Array:
        """ANCHOR."""
        return self._anchors

    def row(self, row: int) -> Array:
        """A copy of the ROW (1,) as it is now."""
        return self._rows[row : row + 1].copy()

    def traced(self, row: int) -> tuple[Array, Array, Array]:
        """NODE, BELIEF and TRACE of the row's nodes so far, in order of time."""
        empty = (np.zeros(0, NODE), np.zeros(0, BELIEF), np.zeros(0, TRACE))
        nodes, beliefs, traces = (np.concatenate(parts) for parts in zip(empty, *self._steps, strict=True))
        own = nodes["row"] == row
        return nodes[own], beliefs[own], traces[own]

    def _believe(self, nodes: Array) -> Array:
        beliefs, traces = np.zeros(len(nodes), BELIEF), np.zeros(len(nodes), TRACE)
        self._pool = with_room(self._pool, KEEP * len(np.unique(nodes["row"])))
        advance_traced(self._rows, self._pool, nodes, self._anchors, self._numbers, self._workspace, beliefs, traces)
        self._steps.append((nodes, beliefs, traces))
        return beliefs


@njit(nogil=True, cache=True)
def advance_traced(
    rows: Any, pool: Any, nodes: Any, anchors: Any, tuning: Any, workspace: Any, beliefs: Any, traces: Any
) -> None:
    """`advance`, one node at a time, and a copy of the heaviest hypotheses after each."""
    work = workspace[0].hypotheses
    for k in range(len(nodes)):
        advance(rows, pool, nodes[k : k + 1], anchors, tuning, workspace, beliefs[k : k + 1])
        row, trace = rows[nodes[k].row], traces[k]
        trace.model, trace.referred, trace.north = row.model, row.referred, row.north
        load(row, pool, work)
        put_in_order(work, row.count)
        trace.count = min(row.count, KEPT)
        for j in range(trace.count):
            h = work[j].order
            trace.log_weight[j] = work[h].log_weight
            trace.kind[j], trace.blocked[j] = work[h].kind, work[h].blocked
            trace.mean[j] = work[h].mean
            trace.cov[j] = work[h].cov

"""What a smoother needs from a run of the engine: its nodes, and the heaviest hypotheses after each of them."""

from typing import Final

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.layout import BELIEF, MAX_HYPOTHESES, Anchors, Beliefs, N, Pool, Rows
from dropanchor_service.estimation.fleet.belief.mixture import sort_by_weight
from dropanchor_service.estimation.fleet.belief.pool import load, with_room
from dropanchor_service.estimation.fleet.belief.step import advance
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.frontend.node import NODE, Nodes
from dropanchor_service.estimation.fleet.tuning import Tuning, TuningRecord

TRACED: Final = 8  # hypotheses of a node

TRACE: Final = np.dtype(
    [
        ("count", np.int32),
        ("model", np.uint8),  # of the heading error, as in the row
        ("referred", np.uint8),
        ("north", np.float64),
        ("log_weight", np.float64, (TRACED,)),  # heaviest first
        ("heading_class", np.int32, (TRACED,)),
        ("nlos", np.int32, (TRACED,)),
        ("mean", np.float64, (TRACED, N)),
        ("cov", np.float64, (TRACED, N, N)),
    ]
)


class TracingEngine(FleetEngine):
    """The engine `fleet` with the same poses, which keeps all nodes and hypotheses. For offline use."""

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
        """Return a copy of ROW (1,) as it is now."""
        return self._rows[row : row + 1].copy()

    def traced(self, row: int) -> tuple[Array, Array, Array]:
        """Return NODE, BELIEF and TRACE of the row's nodes so far, in order of time."""
        empty = (np.zeros(0, NODE), np.zeros(0, BELIEF), np.zeros(0, TRACE))
        nodes, beliefs, traces = (np.concatenate(parts) for parts in zip(empty, *self._steps, strict=True))
        own = nodes["row"] == row
        return nodes[own], beliefs[own], traces[own]

    def _run_belief(self, nodes: Array) -> Array:
        beliefs, traces = np.zeros(len(nodes), BELIEF), np.zeros(len(nodes), TRACE)
        self._pool = with_room(self._pool, MAX_HYPOTHESES * len(np.unique(nodes["row"])))
        advance_traced(
            self._rows, self._pool, nodes, self._anchors, self._tuning_record, self._workspace, beliefs, traces
        )
        self._steps.append((nodes, beliefs, traces))
        return beliefs


@njit(nogil=True, cache=True)
def advance_traced(
    rows: Rows,
    pool: Pool,
    nodes: Nodes,
    anchors: Anchors,
    tuning: TuningRecord,
    workspace: Rows,
    beliefs: Beliefs,
    traces: Array,
) -> None:
    """Run `advance` one node at a time, and copy the heaviest hypotheses after each."""
    work = workspace[0].hypotheses
    for k in range(len(nodes)):
        advance(rows, pool, nodes[k : k + 1], anchors, tuning, workspace, beliefs[k : k + 1])
        row, trace = rows[nodes[k].row], traces[k]
        trace.model, trace.referred, trace.north = row.heading.model, row.heading.in_site_frame, row.heading.north
        load(row, pool, work)
        sort_by_weight(work, row.count)
        trace.count = min(row.count, TRACED)
        for j in range(trace.count):
            h = work[j].by_weight
            trace.log_weight[j] = work[h].log_weight
            trace.heading_class[j], trace.nlos[j] = work[h].heading_class, work[h].nlos
            trace.mean[j] = work[h].mean
            trace.cov[j] = work[h].cov

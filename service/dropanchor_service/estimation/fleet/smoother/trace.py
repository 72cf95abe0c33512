"""What the smoother needs from a run of the engine: its nodes, and what the belief was after each of them."""

from typing import Final, NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.layout import BELIEF, MAX_HYPOTHESES, Anchors, Beliefs, Pool, Rows
from dropanchor_service.estimation.fleet.belief.pool import fitted, load
from dropanchor_service.estimation.fleet.belief.step import advance
from dropanchor_service.estimation.fleet.belief.workspace import WORKING_HYPOTHESIS
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.frontend.node import NODE, Nodes
from dropanchor_service.estimation.fleet.tuning import Tuning, TuningRecord

CHUNK: Final = 64  # nodes for which there is room at a time

TRACE: Final = np.dtype(
    [
        ("first", np.int64),  # of its hypotheses
        ("count", np.int32),
        ("model", np.uint8),  # of the heading error, as the fields that follow, of the row
        ("slow_var", np.float64),
        ("referred", np.uint8),
        ("rigid", np.uint8),
        ("carried", np.uint8),
        ("resolved", np.uint8),
    ]
)


class Run(NamedTuple):
    """The nodes of one row, in order of time, with what the engine made of each."""

    nodes: Array  # NODE
    beliefs: Array  # BELIEF
    traces: Array  # TRACE
    hypotheses: Array  # WORKING_HYPOTHESIS


class TracingEngine(FleetEngine):
    """The engine `fleet` with the same poses, which keeps all nodes and hypotheses. For offline use."""

    def __init__(self, tuning: Tuning | None = None) -> None:
        super().__init__(tuning)
        self._steps: list[Run] = []
        self._traced = 0

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

    def traced(self, row: int) -> Run:
        """Return what was traced of a row so far."""
        empty = Run(np.zeros(0, NODE), np.zeros(0, BELIEF), np.zeros(0, TRACE), np.zeros(0, WORKING_HYPOTHESIS))
        nodes, beliefs, traces, hypotheses = (np.concatenate(parts) for parts in zip(empty, *self._steps, strict=True))
        own = nodes["row"] == row
        return Run(nodes[own], beliefs[own], traces[own], hypotheses)

    def _run_belief(self, nodes: Array, beliefs: Array, lane: int) -> int:
        for k in range(0, len(nodes), CHUNK):
            self._trace(nodes[k : k + CHUNK], beliefs[k : k + CHUNK], self._workspaces[lane])
        return 0

    def _trace(self, nodes: Array, beliefs: Array, workspace: Array) -> None:
        traces, room = np.zeros(len(nodes), TRACE), np.zeros(len(nodes) * MAX_HYPOTHESES, WORKING_HYPOTHESIS)
        self._pool = fitted(self._pool, self._rows[: self._configured], MAX_HYPOTHESES * len(np.unique(nodes["row"])))
        used = advance_traced(
            self._rows, self._pool, nodes, self._anchors, self._tuning_record, workspace, beliefs, traces, room
        )
        traces["first"] += self._traced
        self._traced += used
        self._steps.append(Run(nodes, beliefs, traces, room[:used].copy()))


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
    room: Array,
) -> int:
    """Run `advance` one node at a time, and copy the hypotheses after each. Return how many they are."""
    work = workspace[0].hypotheses
    used = 0
    for k in range(len(nodes)):
        advance(rows, pool, nodes[k : k + 1], anchors, tuning, workspace, beliefs[k : k + 1])
        row, trace = rows[nodes[k].row], traces[k]
        trace.model, trace.slow_var, trace.referred = row.heading.model, row.heading.slow_var, row.heading.in_site_frame
        trace.rigid, trace.carried, trace.resolved = row.mount.rigid, row.walk.carried, row.publication.resolved
        trace.first, trace.count = used, row.count
        load(row, pool, work)
        for h in range(row.count):
            room[used] = work[h]
            used += 1
    return used

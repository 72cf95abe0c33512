"""The engine `fleet`: one row of front-end and pose belief per tag, and a pool of hypotheses for all of them."""

from functools import partial
from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import ANCHOR, Array, PoseBatch, SampleBatch
from dropanchor_service.estimation.fleet.belief.layout import BELIEF, MAX_HYPOTHESES, ROW
from dropanchor_service.estimation.fleet.belief.pool import fitted, make_pool, of_lanes, release
from dropanchor_service.estimation.fleet.belief.step import advance
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.configure import HEIGHT_STD, configure_row
from dropanchor_service.estimation.fleet.frontend.assembly import assemble_nodes
from dropanchor_service.estimation.fleet.frontend.batching import MAX_LAG_S
from dropanchor_service.estimation.fleet.frontend.height import HEIGHT, share_references, start_height
from dropanchor_service.estimation.fleet.frontend.node import NODE
from dropanchor_service.estimation.fleet.frontend.ordering import Due, SampleQueue
from dropanchor_service.estimation.fleet.frontend.platform import PLATFORM
from dropanchor_service.estimation.fleet.frontend.state import FRONTEND, start_frontend
from dropanchor_service.estimation.fleet.lanes import Lanes
from dropanchor_service.estimation.fleet.learned_north import have_own_north, learned_norths, turn_north
from dropanchor_service.estimation.fleet.moved_anchors import follow_moved
from dropanchor_service.estimation.fleet.outputs import (
    Part,
    doubted_of,
    innovations_of,
    joined,
    modes_of,
    poses_of,
    skipped_of,
    stuck_ranges_of,
    with_rows,
)
from dropanchor_service.estimation.fleet.tuning import Tuning

HARD_IRON, HARD_IRON_CALIBRATED = 1.0, 0.05  # prior sd of a magnetometer's hard iron, in units of the field

_BY_ROW = ("rows", "fronts", "platforms", "heights")


class _Run(NamedTuple):
    """What a part of a batch became: NODE, BELIEF of each, and how many at the end have none yet."""

    nodes: Array
    beliefs: Array
    left: int


class FleetEngine:
    """Implement `Engine`, `Restorable`, `DeniesStarts`, `FollowsAnchors`, `FollowsPressure` and `LearnsNorth`.

    A checkpoint copies the rows, the pool and the pending samples.

    max_lag_s: how long the measurements of a row wait at most for IMU samples that come in batches. threads: how many
    share the rows of a batch; the poses are the same, to the last bit.
    """

    name = "fleet"

    def __init__(self, tuning: Tuning | None = None, max_lag_s: float = MAX_LAG_S, threads: int = 1) -> None:
        self._tuning = tuning or Tuning()
        self._tuning_record = self._tuning.record()
        self._anchors = np.zeros(0, ANCHOR)
        self._configured = 0
        self._rows = np.zeros(0, ROW)
        self._fronts = np.zeros(0, FRONTEND)
        self._platforms = np.zeros(0, PLATFORM)
        self._heights = np.zeros(0, HEIGHT)
        self._lanes = Lanes(threads)
        self._pool = make_pool(MAX_HYPOTHESES * 2 * threads, threads)
        self._workspaces = [make_workspace(lane) for lane in range(threads)]
        self._referring: dict[int, None] = {}  # rows whose pressures count from another row
        self._queue = SampleQueue(max_lag_s)

    def set_anchors(self, anchors: Array) -> None:
        """Set ANCHOR, which the `anchor` columns of samples index."""
        self._anchors = anchors.astype(ANCHOR)

    def move_anchors(self, anchors: Array) -> Array:
        """Set ANCHOR, and let the tracks follow those that moved. Return the rows that have to start afresh."""
        before, self._anchors = self._anchors, anchors.astype(ANCHOR)
        return follow_moved(self._rows[: self._configured], self._pool, before, self._anchors[: len(before)])

    def configure(self, row: int, settings: Array) -> None:
        """Make `row` with these TAG_SETTINGS (0-d), or start it again with new ones."""
        self._reserve_rows(row + 1)
        release(self._rows[row], self._pool, 0)
        self._rows[row] = configure_row(settings, self._tuning)
        hard_iron = HARD_IRON_CALIBRATED if settings["magnetometer_calibrated"] else HARD_IRON
        start_frontend(self._fronts[row], hard_iron, float(settings["declination"]), int(settings["motion"]))
        self._platforms[row] = np.zeros((), PLATFORM)
        start_height(self._heights[row], int(settings["height_motion"]), float(settings["height"]), HEIGHT_STD)
        self._queue.forget(row)

    def process(self, samples: SampleBatch) -> PoseBatch:
        """Fuse the samples that are due. Measurements ahead of their row's IMU wait for it.

        They wait 250 ms at most, or as long as the row's IMU samples have been seen to need, up to max_lag_s.
        """
        due = self._queue.due(samples, len(self._anchors))
        if not len(due.order):
            return PoseBatch(rejected=due.rejected, unused=due.unused, lags=due.lags)
        share_references(self._heights, np.fromiter(self._referring, np.int64))
        self._pool = fitted(self._pool, self._rows[: self._configured], MAX_HYPOTHESES, self._lanes.count)
        verdicts = np.zeros(len(samples.imu), np.uint8)
        cuts = self._lanes.cut(due.order, samples.imu["row"], due.events["row"])
        parts = self._lanes.run([partial(self._advance, samples.imu, due, verdicts, cut) for cut in cuts])
        for nodes, beliefs, left in parts:
            self._run_rest(nodes, beliefs, left)
        found = joined(self._lanes.run([partial(self._outputs, part.nodes, part.beliefs) for part in parts]))
        skipped, stuck = skipped_of(samples.imu, verdicts), found.stuck
        doubted = doubted_of(due.events, due.order, len(samples.imu))
        unused = with_rows(with_rows(due.unused, "imu", skipped), "range", stuck)
        return PoseBatch(
            found.poses,
            found.modes,
            found.innovations,
            due.rejected | skipped | stuck | doubted,
            with_rows(unused, "pressure", doubted),
            due.lags,
        )

    def _advance(self, imu: Array, due: Due, verdicts: Array, cut: slice, lane: int) -> _Run:
        """Turn a part of the samples into nodes, and run the belief over them."""
        order = due.order[cut]
        nodes = np.zeros(len(order), NODE)
        rows = (self._fronts, self._platforms, self._rows, self._heights)
        nodes = nodes[: assemble_nodes(imu, due.events, order, *rows, nodes, verdicts)]
        beliefs = np.zeros(len(nodes), BELIEF)
        return _Run(nodes, beliefs, self._run_belief(nodes, beliefs, lane) if len(nodes) else 0)

    def _run_belief(self, nodes: Array, beliefs: Array, lane: int) -> int:
        """Run the belief over the nodes. Return how many are left because the pool has no room."""
        workspace = self._workspaces[lane]
        return int(advance(self._rows, self._pool, nodes, self._anchors, self._tuning_record, workspace, beliefs))

    def _run_rest(self, nodes: Array, beliefs: Array, left: int) -> None:
        """Run the belief over the last nodes of a part for which the pool had no room."""
        while left > 0:
            self._pool = fitted(self._pool, self._rows[: self._configured], MAX_HYPOTHESES, self._lanes.count)
            left = self._run_belief(nodes[-left:], beliefs[-left:], 0)

    def _outputs(self, nodes: Array, beliefs: Array, lane: int) -> Part:
        modes = modes_of(nodes, beliefs, self._rows, self._pool, self._anchors, self._workspaces[lane])
        return Part(poses_of(nodes, beliefs), modes, innovations_of(nodes, beliefs), stuck_ranges_of(nodes, beliefs))

    def _reserve_rows(self, rows: int) -> None:
        """Make room for this many rows: at least twice as many as before, if there is not enough."""
        self._configured = max(self._configured, rows)
        if rows <= len(self._rows):
            return
        for name in _BY_ROW:
            before = getattr(self, f"_{name}")
            room = np.zeros(max(rows, 2 * len(before)), before.dtype)  # takes no memory until it is written
            room[: len(before)] = before
            setattr(self, f"_{name}", room)

    def refer(self, row: int, reference: int) -> None:
        """Compare the pressures of `row` with those of the row `reference`, -1: none. Its estimate goes on."""
        height = self._heights[row]
        if reference < 0:
            self._referring.pop(row, None)
        else:
            self._referring[row] = None
        if height["reference"] != reference:
            height["reference"], height["referred"] = reference, 0

    def are_at_start(self, rows: Array) -> Array:
        """Return whether each of the rows still follows the start in its settings: nothing has denied it."""
        at_start: Array = self._rows["start"]["known"][rows] == 1
        return at_start

    def norths(self, rows: Array) -> Array:
        """Return NORTH of those of the rows whose tracks tell it."""
        return learned_norths(rows, self._rows, self._fronts, self._pool)

    def turn_north(self, row: int, declination: float) -> bool:
        """Use another declination, rad, in `row` if its own start tells it north. Return whether it does."""
        own = bool(have_own_north(self._rows[row : row + 1])[0])
        if own:
            turn_north(self._rows[row], self._fronts[row], declination)
        return own

    def state(self) -> dict[str, Array]:
        """Return the rows, the pool and the pending samples, without copying them."""
        kept = {name: getattr(self, f"_{name}")[: self._configured] for name in _BY_ROW}
        return kept | {"pool": self._pool} | self._queue.state()

    def restore(self, state: dict[str, Array]) -> None:
        """Take over what `state` returned. The settings are part of the rows; the anchors are not."""
        for name in (*_BY_ROW, "pool"):
            setattr(self, f"_{name}", state[name])
        self._configured = len(self._rows)
        self._pool = of_lanes(self._pool, self._rows, self._lanes.count)
        self._referring = dict.fromkeys(np.flatnonzero(self._heights["reference"] >= 0).tolist())
        self._queue.restore(state)

"""The engine `fleet`: one row of front-end and pose belief per tag, and a pool of hypotheses for all of them."""

from collections import Counter
from typing import Any

import numpy as np

from dropanchor_service.estimation.batch import ANCHOR, HYPOTHESIS, POSE, Array, PoseBatch, SampleBatch

from .configure import configured
from .explain import explained
from .frontend import FRONTEND, start_frontend
from .gather import gather
from .kernel import advance
from .layout import AMBIGUOUS, BELIEF, KEEP, ROW, make_pool, make_work
from .modes import list_modes
from .node import NODE, RANGE
from .order import Order
from .platform import PLATFORM
from .tuning import Tuning

HARD_IRON = 1.0  # prior of a magnetometer that nobody calibrated, in units of the field
MODES = 8
ROOM_PER_ROW = 8

_KEPT = ("rows", "fronts", "platforms", "pool")


class FleetEngine:
    """Implements `Engine` and `Restorable`. Rows are plain arrays: a checkpoint is a copy of them and of the pool."""

    name = "fleet"

    def __init__(self, tuning: Tuning | None = None) -> None:
        self._tuning = tuning or Tuning()
        self._numbers = self._tuning.numbers()
        self._anchors = np.zeros(0, ANCHOR)
        self._rows = np.zeros(0, ROW)
        self._fronts = np.zeros(0, FRONTEND)
        self._platforms = np.zeros(0, PLATFORM)
        self._pool = make_pool(KEEP * 2)
        self._work = make_work()
        self._order = Order()

    def set_anchors(self, anchors: Array) -> None:
        """ANCHOR, indexed by the `anchor` columns of samples."""
        self._anchors = anchors.astype(ANCHOR)

    def configure(self, row: int, settings: Array) -> None:
        """Make `row` with these TAG_SETTINGS (0-d), or start it afresh with new ones."""
        missing = row + 1 - len(self._rows)
        if missing > 0:
            self._rows = np.concatenate([self._rows, np.zeros(missing, ROW)])
            self._rows["head"][-missing:] = -1
            self._fronts = np.concatenate([self._fronts, np.zeros(missing, FRONTEND)])
            self._platforms = np.concatenate([self._platforms, np.zeros(missing, PLATFORM)])
        self._release(row)
        self._rows[row] = configured(settings, self._tuning)
        start_frontend(self._fronts[row], HARD_IRON, float(settings["declination"]))
        self._platforms[row] = np.zeros((), PLATFORM)
        self._order.forget(row)

    def process(self, samples: SampleBatch) -> PoseBatch:
        """Fuse the samples that are due; measurements ahead of their row's IMU wait for it, 250 ms at most."""
        rejected: Counter[str] = Counter()
        events = self._order.due(samples, len(self._anchors), rejected)
        if not len(events):
            return PoseBatch(rejected=dict(rejected))
        nodes = np.zeros(len(events), NODE)
        nodes = nodes[: gather(events, self._fronts, self._platforms, self._rows, nodes)]
        self._make_room(np.unique(nodes["row"]))
        beliefs = self._believe(nodes)
        innovations = explained(nodes, beliefs, self._rows["range_scale"][nodes["row"]])
        return PoseBatch(poses_of(nodes, beliefs), self._hypotheses(nodes, beliefs), innovations, dict(rejected))

    def _believe(self, nodes: Array) -> Array:
        """BELIEF, one per node."""
        beliefs = np.zeros(len(nodes), BELIEF)
        advance(self._rows, self._pool, nodes, self._anchors, self._numbers, self._work, beliefs)
        return beliefs

    def state(self) -> dict[str, Array]:
        """Copies of the rows, the pool, and the samples that wait."""
        kept = {name: getattr(self, f"_{name}").copy() for name in _KEPT}
        return kept | self._order.state()

    def restore(self, state: dict[str, Array]) -> None:
        """Take over a state. The settings are part of the rows; the anchors are not."""
        for name in _KEPT:
            setattr(self, f"_{name}", state[name])
        self._order.restore(state)

    def _release(self, row: int) -> None:
        slot = self._rows[row]["head"]
        for _ in range(self._rows[row]["count"]):
            following = self._pool[slot]["next"]
            self._pool[slot]["next"] = self._pool[0]["next"]
            self._pool[0]["next"] = slot
            slot = following
        self._rows[row]["count"] = 0
        self._rows[row]["head"] = -1

    def _make_room(self, rows: Array) -> None:
        """Enough free slots that no row of the batch can run short."""
        needed = int(self._rows["count"].sum()) + KEEP * len(rows) + 1
        have = len(self._pool)
        if needed <= have:
            return
        grown = make_pool(max(needed, 2 * have))
        grown[1:have] = self._pool[1:]
        # free slots: the old list's end leads to the new slots
        grown["next"][:have] = self._pool["next"]
        tail = 0
        while grown["next"][tail] >= 0:
            tail = int(grown["next"][tail])
        grown["next"][tail] = have
        self._pool = grown

    def _hypotheses(self, nodes: Array, beliefs: Array) -> Array:
        """The modes of each row whose last node left it ambiguous."""
        last = np.append(nodes["row"][1:] != nodes["row"][:-1], True) if len(nodes) else np.zeros(0, bool)
        found = [np.zeros(0, HYPOTHESIS)]
        for row in nodes["row"][last & (beliefs["state"] == AMBIGUOUS)]:
            modes = np.zeros(MODES, HYPOTHESIS)
            count = list_modes(self._rows[row], self._pool, self._anchors, self._work, modes)
            modes["row"] = row
            found.append(modes[:count])
        return np.concatenate(found)


def poses_of(nodes: Array, beliefs: Array) -> Any:
    """POSE of every node that ended with a range."""
    chosen = nodes["kind"] == RANGE
    node, belief = nodes[chosen], beliefs[chosen]
    poses = np.zeros(len(node), POSE)
    for name in ("row", "t_ns", "anchor"):
        poses[name] = node[name]
    poses["range"] = node["z"]
    for name in ("state", "reason", "x", "y", "speed", "yaw_rate", "cov", "p_mode", "sigma_pos", "sigma_obs"):
        poses[name] = belief[name]
    poses["heading"] = belief["course"]
    unknown = belief["hypotheses"] == 0
    for name in ("x", "y", "heading", "speed", "cov", "p_mode", "sigma_pos", "sigma_obs"):
        poses[name][unknown] = np.nan
    return poses

"""Compare what the ranges of all tags say with where the site says that its anchors are.

An anchor that is moved makes the ranges of its tags longer or shorter all at once. The track of one tag soon explains
that in another way; several tags, of which some come nearer and others go farther, have nothing else in common.

One that was surveyed wrongly is only seen when tags meet it that know where they are, as another anchor confirms: the
ranges to two anchors soon agree on some place, and only the first one has not had a say in it.
"""

import logging
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from statistics import median

import numpy as np

from dropanchor_service.estimation.columns import Array, Frame, PoseBatch, State, StateReason
from dropanchor_service.ingest.kernels.anchors import HEARD, STEP, follow_anchors
from dropanchor_service.store.anchor_doubts import AnchorDoubt, AnchorDoubts
from dropanchor_service.store.records import enlarged, take

LEAST_M = 0.5  # a shorter step is an error of the ranges
LEAST_ALONE_M = 1.0  # the same, of the only tag that hears an anchor
TOGETHER_NS = 1_500_000_000  # steps of several tags within this time are one
FRESH_NS = 5_000_000_000  # since its last range, after which a tag does not count among those that hear an anchor
SHARE = 3  # one in so many of the tags that hear an anchor has to make the step
FARTHER, SHARE_FARTHER = 3, 2  # tags, and one in so many, if all ranges become longer: something may stand in between
SURE = 3.0  # standard deviations, beyond which a first range contradicts a track
LAST = 24  # tags that met an anchor and count
KEPT_NS = 60_000_000_000  # since its last range to an anchor in doubt, after which a track no longer rests on it

_log = logging.getLogger(__name__)


class AnchorWatch:
    """What each row hears of its anchors. Owned by the ingest thread; anchors by the index of the engine."""

    def __init__(self, doubts: AnchorDoubts, name_of: Callable[[int], str]) -> None:
        """doubts: receives which tags hear an anchor in doubt. name_of: the id of an anchor."""
        self._known = doubts
        self._name_of = name_of
        self._heard = np.zeros(0, HEARD)  # by row
        self._steps: defaultdict[int, dict[int, tuple[int, float]]] = defaultdict(dict)  # by anchor and row: ns, m
        self._met: defaultdict[int, dict[int, float]] = defaultdict(dict)  # by row and anchor: m, of first ranges
        self._firsts: defaultdict[int, dict[int, float]] = defaultdict(dict)  # by anchor and row
        self._doubted: dict[int, AnchorDoubt] = {}
        self._judges = True
        self.any_heard_several = False  # whether any row has ever heard more than one anchor

    def begin(self, row: int) -> None:
        """Forget what a row has heard that starts afresh."""
        self._reserve(row + 1)
        self._met.pop(row, None)
        self._heard[row] = np.zeros((), HEARD)

    def look(self, batch: PoseBatch) -> None:
        """Add new innovations, and take `tracking` from poses that rest on an anchor in doubt, in place."""
        steps = np.empty(len(batch.innovations), STEP)
        count = follow_anchors(batch.innovations, self._heard, steps) if len(steps) else 0
        for row, anchor, t_ns, way, lasts, std in steps[:count].tolist():
            if std == 0.0:
                self._add_step(row, anchor, t_ns, way, alone=lasts and self._hears_one(row, t_ns))
                continue
            self.any_heard_several |= not self._hears_one(row, t_ns)
            if abs(way) <= max(SURE * std, LEAST_M):
                self._meet(row, anchor, 0.0)
            elif _knows_place(batch.poses, row, t_ns):
                self._meet(row, anchor, way)
        if self._doubted:
            self._mark(batch.poses)

    def heard(self, poses: Array) -> tuple[Array, Array]:
        """Return the anchors that the row of each POSE has heard, and which of them it hears."""
        heard = take(self._heard, poses["row"])
        return heard["anchor"], heard["last_ns"] > np.maximum(poses["t_ns"] - FRESH_NS, 0)[:, None]

    def told(self, anchors: Sequence[int]) -> None:
        """Trust these anchors again: somebody has said where they are.

        Their ranges have to agree with the tracks anew before a step counts: what moved tracks with them is none.
        """
        for name in ("clean_s", "before_s"):
            self._heard[name][np.isin(self._heard["anchor"], anchors)] = 0.0
        for row in [row for row, met in self._met.items() if not met.keys().isdisjoint(anchors)]:
            del self._met[row]
        for anchor in anchors:
            self._steps.pop(anchor, None)
            self._firsts.pop(anchor, None)
            if (doubt := self._doubted.pop(anchor, None)) is not None:
                self._known.end(doubt)

    def follow(self, doubted: Mapping[int, AnchorDoubt]) -> None:
        """Doubt these anchors and no others from now on: whoever compared all tags has said so."""
        self._judges = False
        for doubt in self._doubted.values():
            self._known.end(doubt)
        self._doubted = {**doubted}

    def _reserve(self, rows: int) -> None:
        if rows > len(self._heard):
            self._heard = enlarged(self._heard, max(rows, 2 * len(self._heard)))

    def _add_step(self, row: int, anchor: int, t_ns: int, way: float, alone: bool) -> None:
        """Add a step. alone: it lasts, and the tag hears no other anchor, by which it may err."""
        if abs(way) < LEAST_M or anchor in self._doubted:
            return
        steps = self._steps[anchor]
        steps[row] = (t_ns, way)
        for old in [other for other, (at_ns, _) in steps.items() if abs(t_ns - at_ns) > TOGETHER_NS]:
            del steps[old]
        if self._has_moved([way for _, way in steps.values()], self._hearing(anchor, t_ns), alone):
            self._doubt(anchor, max(abs(way) for _, way in steps.values()), min(at_ns for at_ns, _ in steps.values()))

    def _meet(self, row: int, anchor: int, off: float) -> None:
        """Add the first range of a track to an anchor. off: m, by which it contradicts the track, 0: it agrees."""
        met = self._met[row]
        met[anchor] = off
        if len(met) == 1 or all(met.values()):
            return
        for other, way in met.items():
            firsts = self._firsts[other]
            firsts.pop(row, None)
            firsts[row] = way
            if len(firsts) > LAST:
                del firsts[next(iter(firsts))]
            if way and other not in self._doubted:
                ways = [off for off in firsts.values() if off]
                if len(ways) > 1 and self._has_moved(ways, len(firsts), alone=False):
                    self._doubt(other, median(map(abs, ways)), since_ns=0)

    def _doubt(self, anchor: int, way_m: float, since_ns: int) -> None:
        doubt = AnchorDoubt(self._name_of(anchor), way_m, since_ns)
        self._doubted[anchor] = doubt
        _log.warning(
            "anchor %s seems to stand about %.1f m elsewhere: say where it is, or put it again to confirm it",
            *doubt[:2],
        )

    def _has_moved(self, ways: list[float], hearing: int, alone: bool) -> bool:
        """Return whether an anchor has moved whose ranges made these steps. hearing: tags that hear it."""
        if not self._judges:
            return False
        if len(ways) == 1:
            return hearing == 1 and alone and ways[0] < -LEAST_ALONE_M
        if min(ways) > 0.0:
            return len(ways) >= FARTHER and SHARE_FARTHER * len(ways) >= hearing
        return SHARE * len(ways) >= hearing

    def _hearing(self, anchor: int, t_ns: int) -> int:
        """Return how many tags hear an anchor."""
        of_anchor = (self._heard["anchor"] == anchor) & (self._heard["last_ns"] > max(t_ns - FRESH_NS, 0))
        return int(of_anchor.any(axis=1).sum())

    def _hears_one(self, row: int, t_ns: int) -> bool:
        """Return whether a tag hears a single anchor."""
        return int((self._heard["last_ns"][row] > max(t_ns - FRESH_NS, 0)).sum()) == 1

    def _mark(self, poses: Array) -> None:
        heard = take(self._heard, poses["row"])
        fresh = (heard["last_ns"] > 0) & (heard["last_ns"] > poses["t_ns"][:, None] - KEPT_NS)
        for anchor, doubt in self._doubted.items():
            rests = ((heard["anchor"] == anchor) & fresh).any(axis=1)
            poses["reason"][rests & np.isin(poses["state"], (State.TRACKING, State.DEGRADED))] = (
                StateReason.ANCHOR_DOUBTED
            )
            poses["state"][rests & (poses["reason"] == StateReason.ANCHOR_DOUBTED)] = State.AMBIGUOUS
            for row in set(poses["row"][rests].tolist()):
                if self._known.of(row) is None:
                    self._known.set(row, doubt)


def _knows_place(poses: Array, row: int, t_ns: int) -> bool:
    """Return whether a row knows where in the site it is at a time of a POSE: an ambiguous one may be elsewhere."""
    known = (poses["state"] == State.TRACKING) & (poses["frame"] == Frame.SITE)
    return bool((known & (poses["row"] == row) & (poses["t_ns"] == t_ns)).any())

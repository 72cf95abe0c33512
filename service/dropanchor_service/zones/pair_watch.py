"""Find tags that are too close to each other."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit

from dropanchor_schemas.zones import TooCloseRule
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.groups import Groups
from dropanchor_service.zones.concerned import concerned
from dropanchor_service.zones.judge import ENTER_P, EXIT_P, NEAR
from dropanchor_service.zones.probability import p_inside
from dropanchor_service.zones.shapes import disc

MAX_PAIRS: Final = 20_000  # too close at the same time, per rule
MAX_STDS: Final = (
    8.0  # a tag that is less certain than this, in distances of the rule, is never surely close to another
)

Pair = tuple[int, int]


class PairChange(NamedTuple):
    """Two tags that became too close (`is_close`), or are no longer."""

    rows: Pair
    is_close: bool
    since_ns: int
    p: float
    distance_m: float


@njit(cache=True, nogil=True)
def p_close(places: Any, weights: Any, covs: Any, i: int, j: int, around: Any) -> float:
    """Return the probability that the tags i and j are closer than the radius of the polygon `around`."""
    p = p_inside(places[j, 0] - places[i, 0], places[j, 1] - places[i, 1], covs[i] + covs[j], around, 0, len(around))
    return float(p * weights[i] * weights[j])


@njit(cache=True, nogil=True)
def close_pairs(places: Any, stds: Any, weights: Any, covs: Any, distance: float, around: Any, pairs: Any) -> int:
    """Fill `pairs` (n × 2) with tags that are surely too close, and return how many.

    places: n × 2, in ascending order of x. stds: the largest of each tag, m. Stop when `pairs` is full.
    """
    count = 0
    for i in range(len(places)):
        for j in range(i + 1, len(places)):
            dx, dy = places[j, 0] - places[i, 0], abs(places[j, 1] - places[i, 1])
            if dx > distance:
                break
            if dx > distance or dy > distance or weights[i] * weights[j] < ENTER_P:
                continue
            room = distance - math.hypot(dx, dy)  # a mean outside the circle has less than half of the tag inside
            reach = math.hypot(stds[i], stds[j])
            if room < 0.0 or (room < NEAR * reach and p_close(places, weights, covs, i, j, around) < ENTER_P):
                continue
            if count == len(pairs):
                return count
            pairs[count, 0], pairs[count, 1] = i, j
            count += 1
    return count


class PairWatch:
    """The pairs of one rule. One thread owns it. Tags without one surely known place take no part."""

    def __init__(self, rule: TooCloseRule, groups: Groups) -> None:
        self.rule = rule
        self._groups = groups
        self._around = disc(rule.distance_m)
        self._close: dict[Pair, int] = {}  # since when they are too close
        self._pending: dict[Pair, int] = {}
        self.is_full = False

    def restore(self, pair: Pair, since_ns: int) -> None:
        self._close[pair] = since_ns

    def forget(self, pair: Pair) -> None:
        """Forget that a pair is too close."""
        self._close.pop(pair, None)

    def judge(self, rows: Array, modes: Array, name_of: Callable[[int], str], now_ns: int) -> Iterator[PairChange]:
        """Judge the current places of all tags that have one, and yield what has changed.

        modes: MODE of each row. name_of: tag by row.
        """
        if len(rows) < 2 and not self._pending:
            return
        mask = concerned([self.rule], self._groups, [name_of(row) for row in rows.tolist()])[:, 0]
        order = np.flatnonzero(mask)[np.argsort(modes["x"][mask], kind="stable")]
        rows, modes = rows[order], modes[order]
        places, covs = np.column_stack([modes["x"], modes["y"]]), np.ascontiguousarray(modes["cov"])
        weights = np.ascontiguousarray(modes["weight"])
        index = {row: place for place, row in enumerate(rows.tolist())}

        def p_of(pair: Pair) -> float:
            return float(p_close(places, weights, covs, index[pair[0]], index[pair[1]], self._around))

        delay_ns = self.rule.delay_s * 1e9
        for pair in [pair for pair in self._close if pair[0] in index and pair[1] in index]:
            i, j = index[pair[0]], index[pair[1]]
            if weights[i] * weights[j] - p_of(pair) >= EXIT_P:
                del self._close[pair]
                yield PairChange(pair, False, now_ns, 0.0, math.nan)
        seen = {_in_order(pair, rows, name_of) for pair in self._sure(places, weights, covs).tolist()}
        self._pending = {pair: self._pending.get(pair, now_ns) for pair in seen if pair not in self._close}
        for pair, since_ns in [item for item in self._pending.items() if now_ns - item[1] >= delay_ns]:
            self._close[pair] = since_ns
            del self._pending[pair]
            distance_m = math.dist(places[index[pair[0]]], places[index[pair[1]]])
            yield PairChange(pair, True, since_ns, p_of(pair), distance_m)

    def _sure(self, places: Array, weights: Array, covs: Array) -> Array:
        """Return the indices of the tags that are surely too close, two by two."""
        stds = np.sqrt(covs[:, 0, 0] + covs[:, 1, 1])
        known = np.flatnonzero(stds < MAX_STDS * self.rule.distance_m)
        pairs = np.empty((MAX_PAIRS, 2), np.int64)
        count = 0
        if len(known) > 1:
            columns = (places[known], stds[known], weights[known], covs[known])
            count = close_pairs(*columns, self.rule.distance_m, self._around, pairs)
        self.is_full = count == MAX_PAIRS
        return known[pairs[:count]]


def _in_order(pair: Sequence[int], rows: Array, name_of: Callable[[int], str]) -> Pair:
    """Return the rows of a pair, in the order of the names of its tags."""
    one, other = int(rows[pair[0]]), int(rows[pair[1]])
    return (one, other) if name_of(one) < name_of(other) else (other, one)

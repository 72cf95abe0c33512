"""Find tags that are too close to each other."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit

from dropanchor_schemas.zones import TooCloseRule
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.floors import Floors, is_height_known
from dropanchor_service.store.groups import Groups
from dropanchor_service.zones.concerned import concerned
from dropanchor_service.zones.judge import ENTER_P, EXIT_P, NEAR
from dropanchor_service.zones.probability import MIN_STD_M, NODES, WEIGHTS, p_inside
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


PLACE: Final = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("cov", "f8", (2, 2)),
        ("weight", "f8"),  # probability that the tag is there
        ("z", "f8"),  # NaN: not known
        ("z_std", "f8"),
        ("floor", "i8"),  # -1: none
        ("p_floor", "f8"),
    ]
)


@njit(cache=True, nogil=True)
def p_together(one: Any, other: Any) -> float:
    """Return the probability that both tags are at these places, and no ceiling is between them."""
    is_apart = one.floor >= 0 and other.floor >= 0 and one.floor != other.floor
    p_apart = one.p_floor * other.p_floor if is_apart else 0.0
    return float(one.weight * other.weight * (1.0 - p_apart))


@njit(cache=True, nogil=True)
def rise(one: Any, other: Any) -> Any:
    """Return by how much the other tag is higher, and the standard deviation; 0 and 0 where that is not known."""
    dz, std = other.z - one.z, max(math.hypot(one.z_std, other.z_std), MIN_STD_M)
    return (dz, std) if math.isfinite(dz + std) else (0.0, 0.0)


@njit(cache=True, nogil=True)
def p_close(one: Any, other: Any, distance: float, around: Any) -> float:
    """Return the probability that two tags are closer than the distance, which is the radius of the polygon `around`.

    A sphere, cut at the height of the other tag, is a smaller circle: Gauss-Legendre quadrature over these heights.
    """
    x, y, cov = other.x - one.x, other.y - one.y, one.cov + other.cov
    dz, std = rise(one, other)
    if std == 0.0:
        return float(p_inside(x, y, cov, around, 0, len(around)) * p_together(one, other))
    low, high = max(dz - NEAR * std, -distance), min(dz + NEAR * std, distance)
    half, middle = (high - low) / 2.0, (high + low) / 2.0
    total = 0.0
    for k in range(len(NODES) if half > 0.0 else 0):
        height = middle + half * NODES[k]
        scale = 1.0 / math.sqrt(1.0 - (height / distance) ** 2)
        density = math.exp(-0.5 * ((height - dz) / std) ** 2) / (std * math.sqrt(2.0 * math.pi))
        circle = p_inside(x * scale, y * scale, cov * (scale * scale), around, 0, len(around))
        total += half * WEIGHTS[k] * density * circle
    return float(min(total, 1.0) * p_together(one, other))


@njit(cache=True, nogil=True)
def close_pairs(places: Any, distance: float, around: Any, pairs: Any) -> int:
    """Fill `pairs` (n × 2) with tags that are surely too close, and return how many.

    places: PLACE, in ascending order of x. Stop when `pairs` is full.
    """
    count = 0
    for i in range(len(places)):
        one = places[i]
        for j in range(i + 1, len(places)):
            other = places[j]
            if other.x - one.x > distance:
                break
            if abs(other.y - one.y) > distance or p_together(one, other) < ENTER_P:
                continue
            dz, std = rise(one, other)  # a mean outside the sphere has less than half of the tag inside
            room = distance - math.sqrt((other.x - one.x) ** 2 + (other.y - one.y) ** 2 + dz * dz)
            cov = one.cov + other.cov
            reach = math.sqrt(cov[0, 0] + cov[1, 1] + std * std)
            if room < 0.0 or (room < NEAR * reach and p_close(one, other, distance, around) < ENTER_P):
                continue
            if count == len(pairs):
                return count
            pairs[count, 0], pairs[count, 1] = i, j
            count += 1
    return count


def places_of(poses: Array, modes: Array, floors: Floors) -> Array:
    """Return the PLACE of tags that have one place. poses, modes: POSE and MODE of each."""
    places = np.zeros(len(poses), PLACE)
    for name in ("x", "y", "cov", "weight"):
        places[name] = modes[name]
    places["z"] = np.where(is_height_known(poses), poses["z"], np.nan)
    places["z_std"] = poses["z_std"]
    places["floor"], places["p_floor"] = floors.likeliest(poses)
    return places


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

    def judge(self, rows: Array, places: Array, name_of: Callable[[int], str], now_ns: int) -> Iterator[PairChange]:
        """Judge the current places of all tags that have one, and yield what has changed.

        places: PLACE of each row. name_of: tag by row.
        """
        if len(rows) < 2 and not self._pending:
            return
        mask = concerned([self.rule], self._groups, [name_of(row) for row in rows.tolist()])[:, 0]
        order = np.flatnonzero(mask)[np.argsort(places["x"][mask], kind="stable")]
        rows, places = rows[order], places[order]
        index = {row: place for place, row in enumerate(rows.tolist())}

        def p_of(one: Any, other: Any) -> float:
            return float(p_close(one, other, self.rule.distance_m, self._around))

        delay_ns = self.rule.delay_s * 1e9
        for pair in [pair for pair in self._close if pair[0] in index and pair[1] in index]:
            one, other = places[index[pair[0]]], places[index[pair[1]]]
            if one["weight"] * other["weight"] - p_of(one, other) >= EXIT_P:
                del self._close[pair]
                yield PairChange(pair, False, now_ns, 0.0, math.nan)
        seen = {_in_order(pair, rows, name_of) for pair in self._sure(places).tolist()}
        self._pending = {pair: self._pending.get(pair, now_ns) for pair in seen if pair not in self._close}
        for pair, since_ns in [item for item in self._pending.items() if now_ns - item[1] >= delay_ns]:
            self._close[pair] = since_ns
            del self._pending[pair]
            one, other = places[index[pair[0]]], places[index[pair[1]]]
            distance_m = math.hypot(other["x"] - one["x"], other["y"] - one["y"], rise(one, other)[0])
            yield PairChange(pair, True, since_ns, p_of(one, other), distance_m)

    def _sure(self, places: Array) -> Array:
        """Return the indices of the tags that are surely too close, two by two."""
        stds = np.sqrt(places["cov"][:, 0, 0] + places["cov"][:, 1, 1])
        known = np.flatnonzero(stds < MAX_STDS * self.rule.distance_m)
        pairs = np.empty((MAX_PAIRS, 2), np.int64)
        count = close_pairs(places[known], self.rule.distance_m, self._around, pairs) if len(known) > 1 else 0
        self.is_full = count == MAX_PAIRS
        return known[pairs[:count]]


def _in_order(pair: Sequence[int], rows: Array, name_of: Callable[[int], str]) -> Pair:
    """Return the rows of a pair, in the order of the names of its tags."""
    one, other = int(rows[pair[0]]), int(rows[pair[1]])
    return (one, other) if name_of(one) < name_of(other) else (other, one)

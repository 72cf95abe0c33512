"""Test that a pool of another size holds the same hypotheses, and that its size follows their number."""

from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.layout import ROW
from dropanchor_service.estimation.fleet.belief.pool import fitted, make_pool, release

ROOM = 4


def taken(counts: list[int]) -> tuple[Array, Array]:
    """Return rows with so many hypotheses each, which lie mixed in a pool, and the pool: row r has 10 r, 10 r + 1, …"""
    rows, pool = np.zeros(len(counts), ROW), make_pool(1 + sum(counts) + ROOM)
    rows["first_slot"], rows["count"] = -1, 0
    for k in range(max(counts)):
        for row, count in zip(rows, counts, strict=True):
            if k < count:
                slot = pool["next"][0]
                pool["next"][0], pool["next"][slot] = pool["next"][slot], row["first_slot"]
                row["first_slot"], row["count"] = slot, row["count"] + 1
                pool["free"][0] -= 1
    for number, row in enumerate(rows):
        for k, slot in enumerate(slots_of(row, pool)):
            pool["mean"][slot], pool["cov"][slot] = 10 * number + k, -k
    return rows, pool


def slots_of(row: Any, pool: Array) -> list[int]:
    slots, slot = [], int(row["first_slot"])
    for _ in range(row["count"]):
        slots.append(slot)
        slot = int(pool["next"][slot])
    return slots


def free_slots(pool: Array) -> list[int]:
    slots, slot = [], int(pool["next"][0])
    while slot >= 0:
        slots.append(slot)
        slot = int(pool["next"][slot])
    assert len(slots) == pool["free"][0]
    return slots


def held(rows: Array, pool: Array) -> list[list[float]]:
    return [pool["mean"][slots_of(row, pool), 0].tolist() for row in rows]


def test_a_pool_without_room_becomes_a_larger_one_with_the_same_hypotheses() -> None:
    rows, pool = taken([3, 0, 5, 1])
    before = held(rows, pool)
    larger = fitted(pool, rows, 2 * ROOM)
    assert before == held(rows, larger) == [[0.0, 1.0, 2.0], [], [20.0, 21.0, 22.0, 23.0, 24.0], [30.0]]
    assert larger["cov"][slots_of(rows[2], larger), 0].tolist() == [0.0, -1.0, -2.0, -3.0, -4.0]
    assert larger["free"][0] >= 2 * ROOM


def test_every_slot_of_the_other_pool_is_free_or_taken_and_can_be_given_back() -> None:
    rows, pool = taken([3, 0, 5, 1])
    larger = fitted(pool, rows, 2 * ROOM)
    used = [slot for row in rows for slot in slots_of(row, larger)]
    assert sorted(used + free_slots(larger)) == list(range(1, len(larger)))
    for row in rows:
        release(row, larger, 0)
    assert sorted(free_slots(larger)) == list(range(1, len(larger)))


def test_the_hypotheses_of_a_row_lie_one_behind_the_other_in_the_other_pool() -> None:
    rows, pool = taken([3, 0, 5, 1])
    larger = fitted(pool, rows, 2 * ROOM)
    assert [slots_of(row, larger) for row in rows] == [[1, 2, 3], [], [4, 5, 6, 7, 8], [9]]


def test_a_pool_with_enough_room_stays_as_it_is() -> None:
    rows, pool = taken([3, 0, 5, 1])
    assert fitted(pool, rows, ROOM) is pool


def test_the_pool_shrinks_again_when_hypotheses_die() -> None:
    rows, pool = taken([200, 150, 2])
    for row in rows[:2]:
        release(row, pool, 0)
    smaller = fitted(pool, rows, ROOM)
    assert len(smaller) < 10 < 352 < len(pool)
    assert held(rows, smaller) == [[], [], [20.0, 21.0]]
    assert fitted(smaller, rows, ROOM) is smaller

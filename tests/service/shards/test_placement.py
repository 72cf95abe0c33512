"""Where buckets go: off nodes that are drained, from full nodes to empty ones, and never without a standby."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dropanchor_service.cluster.watch import node_of
from dropanchor_service.shards.placement import Hung, Move, Node, Placement, missing_shards

A, B, C = Node("a", 4), Node("b", 4), Node("c", 4)


def placed(nodes: list[Node], **owners: int) -> Placement:
    """Return a placement with so many buckets on each node; all other shards stand by."""
    shards = [f"{node}/{number}" for node, count in owners.items() for number in range(1, count + 1)]
    every = [f"{node.name}/{number}" for node in nodes for number in range(1, node.shards + 1)]
    by_bucket = {f"{number:03d}": shard for number, shard in enumerate(shards)}
    return Placement(nodes, by_bucket, [shard for shard in every if shard not in shards])


@pytest.mark.parametrize(
    ("placement", "move"),
    [
        (placed([A, B], a=2, b=2), None),
        (placed([A, B], a=2, b=1), None),
        (placed([A, B], a=3, b=1), Move("000", "b")),
        (placed([A, B, C], a=2, b=2), Move("000", "c")),
        (placed([A, Node("b", 1)], a=3), None),  # b would be fuller than a is
        (placed([A, Node("b", 1)], a=4), None),
        (placed([A, Node("b", 1), C], a=3, c=1), Move("000", "c")),  # b, the emptiest, would be fuller than a is
        (placed([A, Node("b", 1)], a=3, b=1), None),  # b has no shard that stands by
        (placed([A, Node("b", 4, is_drained=True)], a=3), None),
        (placed([A, Node("b", 4, is_drained=True)], a=3, b=1), Move("003", "a")),
        (placed([Node("a", 4, is_drained=True)], a=1), None),
        (placed([A, B], gone=3, a=1), None),  # standbys take over what a dead node has
        (placed([Node("a", 8), Node("b", 2)], a=4, b=2), None),
        (Placement([], {}, []), None),
    ],
)
def test_the_next_move(placement: Placement, move: Move | None) -> None:
    assert placement.next_move() == move


@given(
    shards=st.lists(st.integers(1, 6), min_size=1, max_size=4),
    owned=st.lists(st.integers(0, 6), min_size=4, max_size=4),
    drained=st.sets(st.integers(0, 3)),
)
@example(shards=[4, 1, 1, 4], owned=[0, 0, 0, 4], drained=set())
def test_moves_come_to_an_end_and_leave_loads_even(shards: list[int], owned: list[int], drained: set[int]) -> None:
    nodes = [Node(f"n{i}", count, i in drained) for i, count in enumerate(shards)]
    counts = {node.name: min(owned[i], node.shards) for i, node in enumerate(nodes)}
    for _ in range(100):
        move = placed(nodes, **counts).next_move()
        if move is None:
            break
        source = node_of(placed(nodes, **counts).owners[move.bucket])
        counts[source] -= 1
        counts[move.to] += 1
    else:
        pytest.fail("buckets move to and fro")
    free = [node for node in nodes if not node.is_drained and counts[node.name] < node.shards]
    assert not (free and any(counts[node.name] for node in nodes if node.is_drained))
    same = [counts[node.name] for node in free if node.shards == free[0].shards]
    assert not same or max(same) - min(same) < 2


def test_a_node_carries_as_many_shards_as_it_says() -> None:
    assert missing_shards(Node("a", 3), ["a/2", "b/1"]) == ["a/1", "a/3"]
    assert missing_shards(Node("a", 0), []) == []


def test_it_says_how_many_buckets_the_loss_of_a_node_would_leave_without_a_standby() -> None:
    assert placed([A, B], a=2, b=2).without_standby() is None
    assert placed([A, B], a=3, b=2).without_standby() == ("b", 1)
    assert placed([Node("a", 8), B], a=5).without_standby() == ("a", 1)
    assert placed([A, Node("b", 4, is_drained=True)], a=1).without_standby() == ("a", 1)


def test_a_shard_that_was_heard_and_is_silent_hangs_sooner_than_one_that_starts() -> None:
    hung = Hung(10.0, start_s=60.0)
    assert hung.find(["a/1", "a/2"], ["a/1"], 0.0) == []
    assert hung.find(["a/1", "a/2"], [], 11.0) == ["a/1"]  # a/2 was never heard: it compiles
    assert hung.find(["a/1", "a/2"], [], 30.0) == []  # it was killed, and starts
    assert hung.find(["a/1"], ["a/1"], 31.0) == []
    hung.look_away()
    assert hung.find(["a/1"], [], 60.0) == []  # the database was away


def test_a_shard_that_is_never_heard_hangs_and_the_one_in_its_place_has_time_to_start() -> None:
    hung = Hung(10.0, start_s=60.0)
    assert hung.find(["a/1", "a/2"], ["a/2"], 0.0) == []
    assert hung.find(["a/1", "a/2"], ["a/2"], 61.0) == ["a/1"]
    assert hung.find(["a/2"], ["a/2"], 62.0) == []
    assert hung.find(["a/1", "a/2"], ["a/2"], 122.0) == []
    assert hung.find(["a/1", "a/2"], ["a/2"], 183.0) == ["a/1"]

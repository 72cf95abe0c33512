"""What an upgrade does next, and what it refuses before it begins."""

from dataclasses import replace

import pytest

from dropanchor_service.checkpoints.layouts import VERSION
from dropanchor_service.cluster.nodes import Waiting
from dropanchor_service.cluster.watch import Lease
from dropanchor_service.shards.placement import Node
from dropanchor_service.shards.upgrade import MoveTo, Restart, Seen, Step, Stop, Wait, next_step, obstacles

OLD, NEW = "0.1.0", "0.2.0"
A, B = Node("a", 2), Node("b", 2)
UNKNOWN = "its settings of sites and tags are not those of the owner"


def waits(name: str, version: str, obstacle: str = "", installed: str = NEW) -> Waiting:
    return Waiting(name, obstacle, version, installed)


def owned(bucket: str, owner: str, version: str, **more: object) -> Lease:
    return replace(Lease(bucket, 1, owner, version=version), **more)  # type: ignore[arg-type]


def seen(waiting: list[Waiting], *leases: Lease, nodes: tuple[Node, ...] = (A, B), head: str = NEW) -> Seen:
    return Seen(head, nodes, waiting, {lease.bucket: lease for lease in leases})


OLD_OWNERS = (owned("001", "a/1", OLD), owned("002", "b/1", OLD))


@pytest.mark.parametrize(
    ("found", "step"),
    [
        (seen([waits("a/2", OLD), waits("b/2", OLD)], *OLD_OWNERS), Restart("a/2", OLD)),
        (seen([waits("b/2", OLD)], *OLD_OWNERS), Wait("a/2 is not running yet")),
        (seen([waits("a/2", NEW, "it is starting"), waits("b/2", OLD)], *OLD_OWNERS), Wait("a/2 starts")),
        (seen([waits("a/2", NEW), waits("b/2", OLD)], *OLD_OWNERS), Restart("b/2", OLD)),
        (seen([waits("a/2", NEW), waits("b/2", NEW)], *OLD_OWNERS), MoveTo("001", "a")),
        (seen([waits("a/1", NEW), waits("b/2", NEW)], owned("001", "a/2", NEW), OLD_OWNERS[1]), MoveTo("002", "b")),
        (
            seen([waits("b/1", NEW), waits("b/2", NEW)], owned("001", "a/1", OLD), owned("002", "a/2", OLD)),
            MoveTo("001", "b"),
        ),
        (
            seen([waits("a/2", NEW), waits("b/2", NEW)], owned("001", "a/1", OLD, is_moving=True), OLD_OWNERS[1]),
            Wait("001 is moving"),
        ),
        (
            seen([waits("a/1", NEW), waits("b/1", NEW)], owned("001", "a/2", NEW), owned("002", "b/2", NEW)),
            None,
        ),
        (
            seen(
                [waits("a/2", NEW), waits("b/2", NEW, "its node is drained")],
                *OLD_OWNERS,
                nodes=(A, replace(B, is_drained=True)),
            ),
            MoveTo("001", "a"),
        ),
    ],
)
def test_shards_that_stand_by_come_first_then_one_bucket_after_another(found: Seen, step: Step | None) -> None:
    assert next_step(found, NEW) == step


@pytest.mark.parametrize(
    ("waiting", "sentence"),
    [
        (waits("a/2", OLD, installed=OLD), "the node a has 0.1.0: install 0.2.0 there"),
        (waits("a/2", OLD, installed=""), "the node a does not say which version it has: install 0.2.0 there"),
        (waits("a/2", NEW, "it has failed: no such file"), "a/2 has failed: no such file"),
        (waits("a/2", NEW, f"001: {UNKNOWN}"), f"cannot take over: 001: {UNKNOWN}; `dropanchor cluster accept 001`"),
        (
            waits("a/2", OLD, installed=f"{NEW} with Ray 2.61.0 under the running 2.60.0"),
            "shards cannot be exchanged under another Ray",
        ),
    ],
)
def test_it_stops_where_an_operator_has_to_act(waiting: Waiting, sentence: str) -> None:
    step = next_step(seen([waiting], OLD_OWNERS[0], nodes=(A,)), NEW)
    assert isinstance(step, Stop)
    assert sentence in step.sentence


def test_before_it_begins_it_names_everything_that_hinders_it() -> None:
    standby = [waits("a/2", OLD), waits("b/2", OLD, installed=OLD)]
    readable = replace(OLD_OWNERS[0], layout=f"{VERSION}-0123456789abcdef")
    assert obstacles(seen(standby[:1], readable), NEW) == []
    ancient, later = (
        replace(readable, layout=name) for name in ("0-0123456789abcdef", f"{VERSION + 1}-0123456789abcdef")
    )
    assert ["does not read the checkpoint of 001" in text for text in obstacles(seen(standby, ancient), NEW)[1:]] == [
        True
    ]
    assert len(obstacles(seen(standby, replace(later, takes_any=True)), NEW)) == 1
    found = obstacles(seen(standby, later, head=OLD), NEW)
    assert [text.partition(":")[0] for text in found] == [
        "the head runs 0.1.0",
        "the node b has 0.1.0",
        f"this version does not read the checkpoint of 001 (layout {later.layout})",
    ]
    assert obstacles(seen([], *OLD_OWNERS, head=""), NEW) == [
        "no head runs: start it, since nothing that ends is started again without it",
        "no shard stands by, so none can take a bucket over: start a node, or one with more --shards",
    ]
    assert obstacles(seen([], owned("001", "a/1", NEW)), NEW) == []  # it is done

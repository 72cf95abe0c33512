"""The supervisor starts shards, ends those that hang, moves buckets one at a time, and is alone."""

import logging
from functools import partial

import pytest

from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import Connection, connect
from dropanchor_service.cluster.head import HeadError, become_head, free_lease, head_of
from dropanchor_service.cluster.leases import ANY, Claimant
from dropanchor_service.cluster.watch import Watch
from dropanchor_service.shards.placement import Node
from dropanchor_service.shards.supervisor import HUNG_S, MOVE_S, SETTLED, Supervisor
from support.postgresql import needs_postgresql

pytestmark = needs_postgresql


class Ray:
    """Nodes and shards that a test gives."""

    def __init__(self, *alive: Node) -> None:
        self.alive = list(alive)
        self.running: list[str] = []
        self.killed: list[str] = []

    def nodes(self) -> list[Node]:
        return self.alive

    def shards(self) -> list[str]:
        return self.running

    def start(self, name: str) -> None:
        self.running.append(name)

    def kill(self, name: str) -> None:
        self.killed.append(name)


def own(connection: Connection, bucket: str, shard: str, renewals: int = SETTLED) -> None:
    seen = leases.seen_or_new(connection, bucket)
    claim = leases.claim(connection, seen, Claimant(shard, "", "", 60.0))
    assert claim is not None
    for _ in range(renewals):
        leases.renew(connection, bucket, claim.epoch)


def moving(connection: Connection) -> dict[str, str]:
    return {name: lease.moving_to for name, lease in leases.read_all(connection).items() if lease.is_moving}


def test_shards_start_buckets_move_one_after_another_and_hung_shards_end(
    url: str, caplog: pytest.LogCaptureFixture
) -> None:
    reach = partial(connect, url, "head")
    ray = Ray(Node("a", 2), Node("b", 2))
    with reach() as connection:
        supervisor = Supervisor(ray, reach, become_head(connection, free_lease(connection), "head", "h:6379", "sites"))
        supervisor.turn(0.0)
        assert ray.running == ["a/1", "a/2", "b/1", "b/2"]
        assert [(row.name, row.shards) for row in nodes.read(connection)] == [("a", 2), ("b", 2)]
        own(connection, "001", "a/1")
        own(connection, "002", "a/2", renewals=SETTLED - 1)
        for name in ("b/1", "b/2"):
            leases.note_standby(connection, ANY, name, None)
        supervisor.turn(1.0)
        assert moving(connection) == {}  # the owner of 002 may be catching up
        leases.renew(connection, "002", 1)
        supervisor.turn(1.0)
        assert moving(connection) == {"001": "b"}
        other = leases.read(connection, "001")
        assert other is not None
        assert not Watch(60.0, "c/1").may_claim(other, 0.0)  # it moves to b alone
        supervisor.turn(1.0 + MOVE_S)
        assert moving(connection) == {}  # nobody took it
        supervisor.turn(3.0 + MOVE_S)
        own(connection, "001", "b/1")
        nodes.set_drained(connection, "a", True)
        supervisor.turn(5.0 + MOVE_S)
        supervisor.turn(7.0 + MOVE_S)
        assert moving(connection) == {"002": "b"}  # off the node that is drained
        own(connection, "002", "b/2")
        ray.running = ["b/1", "b/2"]
        connection.execute("UPDATE dropanchor_standby SET seen = seen - interval '1 min'")
        supervisor.turn(8.0 + MOVE_S)
        assert ray.killed == []
        connection.execute("UPDATE dropanchor_lease SET renewed = renewed - interval '1 h' WHERE bucket = '001'")
        with caplog.at_level(logging.WARNING):
            supervisor.turn(9.0 + MOVE_S + HUNG_S)
        assert ray.killed == ["b/1"]
        assert "the shard b/1 hangs" in caplog.text
        assert "buckets have no shard that stands by" in caplog.text
    supervisor.close()


def test_of_two_heads_one_is_refused_and_a_node_must_have_what_the_head_has(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    reach = partial(connect, url, "head")
    with reach() as connection:
        with pytest.raises(HeadError, match="no head runs"):
            head_of(connection, "sites")
        free = free_lease(connection)
        supervisor = Supervisor(Ray(), reach, become_head(connection, free, "one", "10.0.0.1:6379", "sites"))
        with pytest.raises(HeadError, match=r"one is the head of this cluster, at 10\.0\.0\.1:6379: --join it"):
            become_head(connection, free, "two", "10.0.0.2:6379", "sites")
        assert head_of(connection, "sites").address == "10.0.0.1:6379"
        monkeypatch.setattr("dropanchor_service.cluster.head.time.sleep", lambda _: supervisor.turn(0.0))
        with pytest.raises(HeadError, match=r"one is the head of this cluster, at 10\.0\.0\.1:6379: --join it"):
            free_lease(connection)
        with pytest.raises(HeadError, match="settings of sites and tags are not those of the head one"):
            head_of(connection, "others")
        monkeypatch.setattr("dropanchor_service.cluster.head.version", lambda _: "0.0.9")
        with pytest.raises(HeadError, match=r"the head one has version .*, this machine 0\.0\.9: install the same"):
            head_of(connection, "sites")
        supervisor.give_back()
        become_head(connection, free_lease(connection), "two", "10.0.0.2:6379", "sites")
        supervisor.turn(1.0)
        assert not supervisor.is_head
    supervisor.close()

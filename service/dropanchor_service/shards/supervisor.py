"""Look after nodes and shards: start shards, end those that hang, move buckets, and say what is missing."""

import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Protocol

from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import Connection, DatabaseError, make_tables, sentence_of
from dropanchor_service.cluster.leases import HEAD
from dropanchor_service.cluster.watch import Lease, is_held
from dropanchor_service.shards.placement import Hung, Move, Node, Placement, missing_shards

HUNG_S = 20.0  # since it was heard
START_S = 60.0  # much more than a process needs until it says that it starts
MOVE_S = 10.0  # for a standby to take a bucket over
REST_S = 1.0  # between two moves
SETTLED = 3  # renewals of the lease, in about a second, by which an owner has caught up

_log = logging.getLogger(__name__)


class Shards(Protocol):
    """What places and restarts shards; see `OnRay`."""

    def nodes(self) -> list[Node]: ...

    def shards(self) -> Sequence[str]: ...

    def start(self, name: str) -> None: ...

    def kill(self, name: str) -> None: ...


class Supervisor:
    """Call `turn` about twice a second. connect: raises DatabaseError. epoch: of the lease of the head."""

    def __init__(self, shards: Shards, connect: Callable[[], Connection], epoch: int) -> None:
        self._shards = shards
        self._connect = connect
        self._epoch = epoch
        self._connection: Connection | None = None
        self._hung = Hung(HUNG_S, START_S)
        self._move: tuple[Move, int, float] | None = None  # epoch before it, and when it is given up
        self._rests_until_s = 0.0
        self._drained: set[str] = set()
        self._said: set[str] = set()
        self.is_head = True

    def turn(self, now_s: float) -> None:
        """Do what is due. Without the database, shards are started, but nothing else happens."""
        alive = self._shards.nodes()
        running = self._shards.shards()
        for node in alive:
            for name in [] if node.name in self._drained else missing_shards(node, running):
                _log.info("starting the shard %s", name)
                self._shards.start(name)
        try:
            if self._connection is None:
                self._connection = self._connect()
                make_tables(self._connection)
            self._with_database(self._connection, alive, running, now_s)
        except DatabaseError as error:
            self._say("database", f"the database does not answer: {sentence_of(error)}")
            self._hung.look_away()
            self.close()
        else:
            self._say("database", "")

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def give_back(self) -> None:
        """Let another process be the head at once."""
        if self._connection is not None and self.is_head:
            leases.release(self._connection, HEAD, self._epoch)

    def _with_database(
        self, connection: Connection, alive: Sequence[Node], running: Collection[str], now_s: float
    ) -> None:
        self.is_head = leases.renew(connection, HEAD, self._epoch)
        if not self.is_head:
            return
        for node in alive:
            nodes.note(connection, node.name, node.shards)
        self._drained = {row.name for row in nodes.read(connection) if row.is_drained}
        owned = {name: lease for name, lease in leases.read_all(connection).items() if lease.owner}
        standbys = nodes.standbys(connection)
        fresh = {lease.owner for lease in owned.values() if is_held(lease)}
        self._kill_hung(running, {*fresh, *standbys}, now_s)
        placement = Placement(
            nodes=[replace(node, is_drained=node.name in self._drained) for node in alive],
            owners={name: lease.owner for name, lease in owned.items() if is_held(lease)},
            standbys=[name for name, why_not in standbys.items() if not why_not],
        )
        self._move_one(connection, placement, owned, now_s)
        self._warn(placement)

    def _kill_hung(self, running: Collection[str], heard: Collection[str], now_s: float) -> None:
        for name in self._hung.find(running, heard, now_s):
            _log.warning("the shard %s hangs: it renews no lease, does not stand by, and does not start", name)
            self._shards.kill(name)

    def _move_one(self, connection: Connection, placement: Placement, owned: dict[str, Lease], now_s: float) -> None:
        """Move one bucket at a time, so that a mistake concerns few."""
        if self._move is not None:
            move, epoch, until_s = self._move
            lease = owned.get(move.bucket)
            if lease is not None and lease.epoch == epoch and now_s < until_s:
                return
            if lease is not None and lease.epoch == epoch:
                leases.set_moving(connection, move.bucket, False)
                _log.warning("no standby on %s took %s over", move.to, move.bucket)
            self._move, self._rests_until_s = None, now_s + REST_S
        if now_s < self._rests_until_s or any(map(_changes_hands, owned.values())):
            return
        found = placement.next_move()
        if found is not None:
            _log.info("moving %s from %s to %s", found.bucket, placement.owners[found.bucket], found.to)
            self._move = found, owned[found.bucket].epoch, now_s + MOVE_S
            leases.set_moving(connection, found.bucket, True, found.to)

    def _warn(self, placement: Placement) -> None:
        found = placement.without_standby()
        sentence = (
            ""
            if found is None
            else f"if {found[0]} dies, {found[1]} buckets have no shard that stands by: add nodes, or shards to them"
        )
        self._say("spare", sentence)

    def _say(self, kind: str, sentence: str) -> None:
        """Log a sentence once, until it changes."""
        if sentence and (line := f"{kind} {sentence}") not in self._said:
            self._said = {each for each in self._said if not each.startswith(kind)} | {line}
            _log.warning("%s", sentence)
        elif not sentence:
            self._said = {each for each in self._said if not each.startswith(kind)}


def _changes_hands(lease: Lease) -> bool:
    """Return whether a bucket is moving, or has an owner that may still be catching up."""
    return lease.is_moving or (is_held(lease) and lease.renewals < SETTLED)

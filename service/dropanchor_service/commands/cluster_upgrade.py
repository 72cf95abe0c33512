"""`dropanchor cluster upgrade`: let all shards run the version that is installed, one after another."""

import argparse
import time

from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import Connection
from dropanchor_service.cluster.leases import HEAD, HEAD_SEEN_S
from dropanchor_service.cluster.versions import installed
from dropanchor_service.cluster.watch import is_held
from dropanchor_service.commands.cluster_move import moved
from dropanchor_service.commands.cluster_options import refuse
from dropanchor_service.shards.placement import Node
from dropanchor_service.shards.upgrade import MoveTo, Restart, Seen, Stop, Wait, next_step, obstacles

DESCRIPTION = """\
Lets all shards run the version that is installed on their nodes, one after another, while the sites are served: a
shard with the new version takes each bucket over before the old one leaves. Run it where the new version is
installed. It stops at the first failure and says what to do; run again, it goes on from there.
"""
EPILOG = """\
before it:
  1. install the new version on all nodes and on the head:  pip install 'dropanchor-service[cluster]==NEW'
  2. on each node, once, so that no shard has to wait:      dropanchor compile
  3. on the head:                                           dropanchor cluster stop, then start
after it, restart each `dropanchor api`, and `stop` and `start` each node when it suits you.
"""
WAIT_S = 300.0  # for a shard to start: a new version may have to compile
MOVE_S = 15.0
HEAD_S = 60.0  # for a head to see its nodes
POLL_S = 0.1


def add_arguments(upgrade: argparse.ArgumentParser) -> None:
    upgrade.description, upgrade.epilog = DESCRIPTION, EPILOG
    upgrade.formatter_class = argparse.RawDescriptionHelpFormatter
    upgrade.add_argument("--check", action="store_true", help="say what would hinder it, and change nothing")


def upgrade(arguments: argparse.Namespace, connection: Connection) -> int:
    """Run the command. Return 0, or 2 if something hinders it."""
    target = installed()
    seen = _seen_by_head(connection)
    if not seen.nodes:
        return refuse("no head sees a node; `upgrade` is for shards that `dropanchor cluster start` runs")
    found = obstacles(seen, target)
    if found:
        return refuse("\n  ".join(["the upgrade cannot begin:", *found]))
    old = sum(version != target for version in seen.shards.values())
    if arguments.check:
        print(f"{old} of {len(seen.shards)} shards are not {target} yet, and nothing hinders an upgrade.")
        return 0
    return _Upgrade(connection, target).run()


def seen_in(connection: Connection) -> Seen:
    """Return the cluster as its tables show it. Nodes that the head no longer sees are left out."""
    head = leases.read(connection, HEAD) if leases.has_head(connection) else None
    alive = [row for row in nodes.read(connection) if row.shards and row.age_s < HEAD_SEEN_S]
    return Seen(
        head="" if head is None else head.version,
        nodes=[Node(row.name, row.shards, row.is_drained) for row in alive],
        waiting=nodes.waiting(connection),
        leases={name: lease for name, lease in leases.read_all(connection).items() if is_held(lease)},
    )


def _seen_by_head(connection: Connection) -> Seen:
    """Return the cluster, once a head that has just started sees its nodes, or sees none for long."""
    end_s = time.monotonic() + HEAD_S
    while not (seen := seen_in(connection)).nodes and seen.head and time.monotonic() < end_s:
        time.sleep(POLL_S)
    return seen


class UpgradeError(ValueError):
    """The upgrade cannot go on; the message says why, and what to do."""


class _Upgrade:
    """Takes one step after another, and tells each."""

    def __init__(self, connection: Connection, target: str) -> None:
        self._connection = connection
        self._target = target
        self._restarted: set[str] = set()

    def run(self) -> int:
        try:
            while (step := self._next()) is not None:
                if isinstance(step, MoveTo):
                    self._move(step)
                else:
                    self._restart(step)
        except UpgradeError as error:
            return refuse(f"{error}.\nThen run `dropanchor cluster upgrade` again: it goes on from there.")
        _say(f"All {len(seen_in(self._connection).shards)} shards run {self._target}.")
        return 0

    def _next(self) -> Restart | MoveTo | None:
        """Wait until there is something to do, and return it. Raises UpgradeError."""
        end_s, said = time.monotonic() + WAIT_S, ""
        while time.monotonic() < end_s:
            step = next_step(seen_in(self._connection), self._target)
            if isinstance(step, Stop):
                raise UpgradeError(step.sentence)
            if not isinstance(step, Wait):
                return step
            if step.sentence != said:
                said = step.sentence
                _say(f"  waiting: {said}")
            time.sleep(POLL_S)
        raise UpgradeError(
            f"{said} for {WAIT_S:.0f} s; the log of that shard, or `dropanchor cluster status`, says why"
        )

    def _restart(self, step: Restart) -> None:
        if step.shard in self._restarted:
            raise UpgradeError(f"{step.shard} runs {step.version} again: which Python was its node started with?")
        self._restarted.add(step.shard)
        _say(f"{step.shard}: {step.version} -> {self._target}")
        nodes.ask_to_end(self._connection, step.shard)
        end_s = time.monotonic() + MOVE_S
        while any(shard.name == step.shard and shard.version == step.version for shard in self._waiting()):
            if time.monotonic() > end_s:
                nodes.ask_to_end(self._connection, step.shard, asks=False)
                raise UpgradeError(f"{step.shard} does not end: see its log, and end its process")
            time.sleep(POLL_S)

    def _waiting(self) -> list[nodes.Waiting]:
        return nodes.waiting(self._connection)

    def _move(self, step: MoveTo) -> None:
        before = leases.read_all(self._connection)
        former = before[step.bucket]
        after = moved(self._connection, former, step.node, MOVE_S)
        if after is None:
            raise UpgradeError(f"no shard on {step.node} took {step.bucket} over within {MOVE_S:.0f} s: see their logs")
        if after.version != self._target:
            raise UpgradeError(
                f"{after.owner} took {step.bucket} over, and runs {after.version}: install it there, too"
            )
        done = 1 + sum(lease.version == self._target for lease in before.values())
        owners = f"{former.owner} ({former.version}) -> {after.owner} ({after.version})"
        _say(f"{step.bucket}: {owners}, epoch {after.epoch}, {done} of {len(before)} buckets")


def _say(line: str) -> None:
    print(line, flush=True)  # also into a pipe, since an upgrade takes minutes

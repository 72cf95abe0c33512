"""Everything that happens to the hosts of a cluster in a trial."""

import signal
import time
from contextlib import suppress

from benchmarks.host_trial import HEAD, NODES, HostTrial, start_node
from benchmarks.router_cell import RouterCell
from support.hosts import Hosts
from support.postgresql import Postgresql
from support.zenoh_router import wait_until

CALM_S, FROZEN_S, CUT_S, ROUTER_GONE_S, HEAD_GONE_S, DATABASE_GONE_S = 20.0, 20.0, 25.0, 3.0, 5.0, 8.0
BUSY_S, UPGRADE_S = 240.0, 900.0  # longest waits, on a busy machine
OLD, NEW = "8.1.0", "8.2.0"


class HostFailures:
    """Lets one failure after another happen. Each is over when its parts run again, or when they have been started."""

    def __init__(self, trial: HostTrial, hosts: Hosts, cell: RouterCell, database: Postgresql) -> None:
        self._trial = trial
        self._cluster = trial.cluster
        self._hosts = hosts
        self._cell = cell
        self._database = database

    def all(self) -> None:
        measure = self._trial.measure
        measure(f"nothing for {CALM_S:.0f} s", self._nothing)  # what the machine itself adds to the others
        measure("planned move", self._move)
        measure("kill -9 of a shard", self._kill_shard)
        measure(f"a shard frozen for {FROZEN_S:.0f} s", self._freeze_shard)
        measure("kill -9 of all processes of a host", self._kill_host)
        measure("kill -9 of a raylet", self._kill_raylet)
        measure(f"a host frozen for {FROZEN_S:.0f} s", self._freeze_host)
        measure(f"a host cut off for {CUT_S:.0f} s", self._cut_off)
        measure(f"the head gone for {HEAD_GONE_S:.0f} s", self._head_away)
        measure(f"PostgreSQL gone for {DATABASE_GONE_S:.0f} s", self._database_away)
        measure(f"the router gone for {ROUTER_GONE_S:.0f} s", self._router_away)
        measure("`cluster upgrade` of all shards", self._upgrade)

    def _nothing(self, _: str, __: str) -> None:
        time.sleep(CALM_S)

    def _move(self, node: str, _: str) -> None:
        to = next(name for name in NODES if name != node)
        moved = self._cluster.run("move", "001", "--to", to)
        assert moved.returncode == 0, moved.stderr

    def _kill_shard(self, _: str, shard: str) -> None:
        self._cluster.signal_shard(shard, "001", signal.SIGKILL)

    def _freeze_shard(self, _: str, shard: str) -> None:
        self._cluster.signal_shard(shard, "001", signal.SIGSTOP)
        time.sleep(FROZEN_S)
        with suppress(ProcessLookupError):  # the head may have ended it
            self._cluster.signal_shard(shard, "001", signal.SIGCONT)

    def _kill_host(self, node: str, _: str) -> None:
        self._cluster.kill(node)
        start_node(self._cluster, node)

    def _kill_raylet(self, node: str, _: str) -> None:
        self._cluster.kill_raylet(node)
        self._restart(node)

    def _freeze_host(self, node: str, _: str) -> None:
        self._cluster.send(node, signal.SIGSTOP)
        time.sleep(FROZEN_S)
        self._cluster.send(node, signal.SIGCONT)
        self._restart(node)

    def _cut_off(self, node: str, _: str) -> None:
        self._hosts.set_link(NODES[node], "down")
        time.sleep(CUT_S)
        self._hosts.set_link(NODES[node], "up")
        self._restart(node)

    def _head_away(self, _: str, __: str) -> None:
        self._cluster.kill("head")
        time.sleep(HEAD_GONE_S)
        self._cluster.start("head", HEAD, "--head")

    def _database_away(self, _: str, __: str) -> None:
        self._database.stop()
        time.sleep(DATABASE_GONE_S)
        self._database.start()

    def _router_away(self, _: str, __: str) -> None:
        self._cell.restart_after(ROUTER_GONE_S)

    def _upgrade(self, _: str, __: str) -> None:
        for name in ("head", *NODES):
            self._cluster.install(name, NEW)
        self._cluster.stop("head")
        self._cluster.start("head", HEAD, "--head")
        wait_until(self._cluster.has_head, BUSY_S)
        done = self._cluster.run("upgrade", limit_s=UPGRADE_S)
        assert done.returncode == 0, done.stdout + done.stderr

    def _restart(self, node: str) -> None:
        """Start a node again once its process has ended, as a service manager does."""
        self._cluster.wait(node)
        start_node(self._cluster, node)

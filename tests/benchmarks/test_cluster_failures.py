"""Measure how long the poses of a cluster stop in each failure, and account for every sample."""

import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest

from benchmarks import report
from support.cluster import Cluster, needs_ray, running_cluster
from support.cluster_sites import Reader, nodes_of, require_each_sample_once, settings_of_sites
from support.live_tags import LiveTags
from support.postgresql import Postgresql, needs_postgresql, running_postgresql
from support.zenoh_router import connected_session, free_endpoint, router_process, wait_until

pytestmark = [pytest.mark.benchmark, needs_ray, needs_postgresql]

BUCKETS, SITES_EACH, TAGS = 3, 2, 2
NODES = {"a": 3, "b": 4, "c": 5}
SHARDS = 2
SITES = {f"{bucket:03d}.s{site}": 10 * bucket + site for bucket in range(1, BUCKETS + 1) for site in range(SITES_EACH)}


class Trial:
    """Lets failures happen to a cluster and notes the silence."""

    def __init__(self, cluster: Cluster, reader: Reader) -> None:
        self.cluster = cluster
        self._reader = reader
        self.silences: dict[str, float] = {}

    def start(self, name: str) -> None:
        self.cluster.start(name, NODES[name], "--join", "--shards", str(SHARDS))

    def wait_until_whole(self) -> None:
        """Wait until there is a head, each node serves a bucket, and all other shards stand by."""
        wait_until(self._is_whole, 240.0)
        time.sleep(3.0)

    def _is_whole(self) -> bool:
        self.cluster.restart_ended()
        spare = len(NODES) * SHARDS - BUCKETS
        all_serve = nodes_of(self.cluster) == set(NODES)
        return all_serve and len(self.cluster.standbys()) == spare and self.cluster.has_head()

    def measure(self, what: str, fail: Callable[[str, str], None], mend: Callable[[str], None]) -> None:
        """Note the longest time without a pose until all is as before. fail: gets the node of 001, and its shard."""
        began_s, shard = time.monotonic(), self.cluster.owners()["001"]
        node = shard.partition("/")[0]
        fail(node, shard)
        failed_s = time.monotonic()
        wait_until(lambda: self._reader.are_current(failed_s), 60.0)
        mend(node)
        self.wait_until_whole()
        self.silences[what] = max(self._reader.silences_s(began_s).values())
        print(f"{what}: {self.silences[what]:.2f} s", flush=True)


def test_every_failure_ends_and_costs_no_sample(tmp_path: Path) -> None:
    router, reader = free_endpoint(), Reader(SITES)
    with ExitStack() as opened:
        opened.enter_context(router_process(router))
        database = opened.enter_context(running_postgresql())
        cluster = opened.enter_context(running_cluster(database, router, settings_of_sites(SITES, TAGS)))
        trial = Trial(cluster, reader)
        cluster.start("head", 2, "--head")
        wait_until(cluster.has_head, 60.0)
        for name in NODES:
            trial.start(name)
        opened.enter_context(reader.subscribed(opened.enter_context(connected_session(router))))
        trial.wait_until_whole()
        tags = {
            site: opened.enter_context(LiveTags(router, TAGS, seed=seed, site=site, cache_messages=1200))
            for site, seed in SITES.items()
        }
        began_s = time.monotonic()
        wait_until(lambda: reader.are_current(began_s))
        _all_failures(trial, database)
        require_each_sample_once(cluster, tags, tmp_path)
    lines = [f"| {what} | {silence_s:.1f} |" for what, silence_s in trial.silences.items()]
    samples = sum(count for of in tags.values() for counts in of.samples.values() for count in counts.values())
    facts = (
        f"{len(NODES)} nodes of {SHARDS} shards; {len(SITES)} sites in {BUCKETS} buckets, {TAGS} tags each with 10 "
        f"messages per second; lease 2 s. Each of {samples:,} samples was used once; {reader.dropped} poses of former "
        "owners were dropped."
    )
    head = ["| failure | longest silence of any site, s |", "|---|---|"]
    report.record("cluster", "\n".join([*head, *lines, "", facts]))


def _all_failures(trial: Trial, database: Postgresql) -> None:
    cluster = trial.cluster

    def restart(node: str) -> None:
        cluster.wait(node)
        trial.start(node)

    def nothing(_: str) -> None:
        return

    def move(node: str, _: str) -> None:
        to = next(name for name in NODES if name != node)
        moved = cluster.run("move", "001", "--to", to)
        assert moved.returncode == 0, moved.stderr

    def freeze(node: str, _: str) -> None:
        cluster.send(node, signal.SIGSTOP)
        time.sleep(20.0)
        cluster.send(node, signal.SIGCONT)

    def signal_shard(how: signal.Signals, _: str, shard: str) -> None:
        cluster.signal_shard(shard, "001", how)

    def head_dies(_: str, __: str) -> None:
        cluster.kill("head")
        time.sleep(5.0)
        cluster.start("head", 2, "--head")

    def head_dies_while_shards_start(node: str, _: str) -> None:
        words = f"starting the shard {node}/"
        before = cluster.count_said("head", words)
        cluster.kill(node)
        trial.start(node)
        wait_until(lambda: cluster.count_said("head", words) > before, 60.0)
        cluster.kill("head")
        cluster.start("head", 2, "--head")

    def database_away(_: str, __: str) -> None:
        database.stop()
        time.sleep(8.0)
        database.start()

    trial.measure("planned move", move, nothing)
    trial.measure("kill -9 of a shard", partial(signal_shard, signal.SIGKILL), nothing)
    trial.measure("a shard hangs", partial(signal_shard, signal.SIGSTOP), nothing)
    trial.measure("kill -9 of all processes of a node", lambda node, _: cluster.kill(node), trial.start)
    trial.measure("kill -9 of a raylet", lambda node, _: cluster.kill_raylet(node), restart)
    trial.measure("head gone for 5 s", head_dies, nothing)
    trial.measure("kill -9 of the head while shards of a node start again", head_dies_while_shards_start, nothing)
    trial.measure("PostgreSQL away for 8 s", database_away, nothing)
    trial.measure("node frozen for 20 s", freeze, restart)

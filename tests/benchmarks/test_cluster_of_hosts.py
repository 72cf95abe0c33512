"""Measure what a cluster of hosts with a network between them survives: a dead host, a cut cable, a dead router.

The hosts are network namespaces of this machine. Every tag has a cache, and every shard the real engine.
"""

import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from benchmarks import report
from benchmarks.cached_tags import CACHED
from benchmarks.fleet_of_sites import FleetOfSites, running_fleet
from benchmarks.frame_reader import FrameReader
from benchmarks.host_trial import HostTrial
from benchmarks.motion import MESSAGE_S, SAMPLES_PER_MESSAGE
from benchmarks.router_cell import RouterCell, running_cell
from benchmarks.site_accounts import Accounts
from support.cluster import needs_ray, running_cluster
from support.hosts import Hosts, running_hosts, why_not
from support.postgresql import needs_postgresql, running_postgresql
from support.zenoh_router import connected_session, free_port, wait_until

pytestmark = [pytest.mark.benchmark, needs_ray, needs_postgresql]

BUCKETS = ("001", "002", "003")
SITES = [f"{bucket}.s{site}" for bucket in BUCKETS for site in range(20)]
TAGS, SHARDS = 5, 2
HEAD, NODES = 2, {"a": 3, "b": 4, "c": 5}
CUT_S, ROUTER_GONE_S = 25.0, 3.0
# All hosts share this machine. When it is busy, none of them is to take a burst from the caches for an overload.
PATIENCE = ("[ingest]", "max_wait_ms = 10000")


def test_hosts_fail_and_every_sample_is_used_once(tmp_path: Path) -> None:
    if reason := why_not():
        pytest.skip(reason)
    accounts, reader = Accounts(SITES, TAGS), FrameReader(SITES)
    with ExitStack() as opened:
        hosts = opened.enter_context(running_hosts([HEAD, *NODES.values()]))
        cell = opened.enter_context(running_cell(f"tcp/{hosts.outside}:{free_port()}"))
        database = opened.enter_context(running_postgresql(host=hosts.outside))
        cluster = opened.enter_context(
            running_cluster(database, cell.endpoint, [*accounts.settings(), *PATIENCE], hosts)
        )
        cluster.start("head", HEAD, "--head")
        wait_until(cluster.has_head, 120.0)
        for node, number in NODES.items():
            cluster.start(node, number, "--join", "--shards", str(SHARDS))
        wait_until(lambda: len(cluster.owners()) == len(BUCKETS), 240.0)
        fleet = opened.enter_context(running_fleet(cell.endpoint, TAGS, SITES))
        opened.enter_context(reader.subscribed(opened.enter_context(connected_session(cell.endpoint))))
        trial = HostTrial(cluster, reader, fleet, accounts, NODES, SHARDS)
        _all_failures(trial, hosts, cell)
        farthest_m = accounts.farthest_m(cluster, fleet.numbers, fleet.start_ns, tmp_path)
    _record(trial, reader, fleet, farthest_m)
    assert not trial.errors
    assert farthest_m < 0.01


def _all_failures(trial: HostTrial, hosts: Hosts, cell: RouterCell) -> None:
    cluster = trial.cluster

    def dies(node: str) -> None:
        cluster.kill(node)
        trial.start(node)

    def cut_off(node: str) -> None:
        hosts.set_link(NODES[node], "down")
        time.sleep(CUT_S)
        hosts.set_link(NODES[node], "up")
        cluster.wait(node)
        trial.start(node)

    trial.measure("kill -9 of all processes of a host", BUCKETS, dies)
    trial.measure(f"a host cut off for {CUT_S:.0f} s", BUCKETS, cut_off)
    trial.measure(f"the router gone for {ROUTER_GONE_S:.0f} s", BUCKETS, lambda _: cell.restart_after(ROUTER_GONE_S))


def _record(trial: HostTrial, reader: FrameReader, fleet: FleetOfSites, farthest_m: float) -> None:
    silences = " | ".join(f"silence of {bucket}, s" for bucket in BUCKETS)
    head = f"| failure | {silences} | samples lost | used twice | frames of former owners, dropped |"
    count = len(fleet.numbers) * len(SITES) * TAGS * SAMPLES_PER_MESSAGE
    facts = (
        f"{len(NODES)} hosts of {SHARDS} shards; {len(SITES)} sites with {TAGS} tags each, {1 / MESSAGE_S:.0f} "
        f"messages per second and tag, the last {CACHED} in its cache; {count:,} samples. Of 100 bursts of messages, "
        f"99 left within {fleet.late_p99_ms:.0f} ms. The last poses lie at most {1000 * farthest_m:.1f} mm from those "
        f"of a service that nothing disturbed. While buckets moved, {reader.of_two_owners} accepted frames of one site "
        f"were of the former owner when another site already had the new one; {reader.backwards} accepted frames had "
        "older poses than the one before."
    )
    report.record("hosts", "\n".join([head, "|---" * (len(BUCKETS) + 4) + "|", *trial.rows, "", facts]))

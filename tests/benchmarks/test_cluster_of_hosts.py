"""Measure what a cluster of hosts with a network between them survives: failures of each part, and planned acts.

The hosts are network namespaces of this machine. Every tag has a cache, and every shard the real engine.
DROPANCHOR_TRIAL_TAGS says how many tags a site has.
"""

import os
from contextlib import ExitStack
from pathlib import Path

import pytest

from benchmarks import report
from benchmarks.cached_tags import CACHED
from benchmarks.cpu_shares import shares_of_cores
from benchmarks.fleet_of_sites import FleetOfSites, running_fleet
from benchmarks.frame_reader import FrameReader
from benchmarks.host_failures import OLD, HostFailures
from benchmarks.host_trial import HEAD, NODES, SHARDS, HostTrial, start_node
from benchmarks.motion import MESSAGE_S
from benchmarks.router_cell import running_cell
from benchmarks.site_accounts import Accounts
from benchmarks.undisturbed import Undisturbed
from support.cluster import needs_ray, running_cluster
from support.hosts import running_hosts, why_not
from support.postgresql import needs_postgresql, running_postgresql
from support.zenoh_router import connected_session, free_port, wait_until

pytestmark = [pytest.mark.benchmark, needs_ray, needs_postgresql]

SITES = [f"{bucket}.s{site}" for bucket in ("001", "002", "003") for site in range(20)]
TAGS = int(os.environ.get("DROPANCHOR_TRIAL_TAGS", "10"))
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
        settings = [*accounts.settings(), *PATIENCE]
        cluster = opened.enter_context(running_cluster(database, cell.endpoint, settings, hosts))
        for name in ("head", *NODES):
            cluster.install(name, OLD)
        cluster.start("head", HEAD, "--head")
        wait_until((cluster.folder / "token").exists, 120.0)
        for node in NODES:
            start_node(cluster, node)
        wait_until(lambda: len(cluster.owners()) == len(accounts.buckets), 240.0)
        fleet = opened.enter_context(running_fleet(cell.endpoint, TAGS, SITES))
        undisturbed = Undisturbed(accounts, fleet.start_ns, tmp_path)
        trial = HostTrial(cluster, reader, fleet, accounts, undisturbed)
        opened.enter_context(reader.subscribed(opened.enter_context(connected_session(cell.endpoint))))
        trial.begin()
        shares = shares_of_cores(cluster, fleet, cell, database)
        HostFailures(trial, hosts, cell, database).all()
    _record(trial, reader, fleet, shares)
    assert not trial.errors
    assert trial.farthest_m < 0.01


def _record(trial: HostTrial, reader: FrameReader, fleet: FleetOfSites, shares: dict[str, float]) -> None:
    busy = ", ".join(f"{kind} {cores:.2f}" for kind, cores in shares.items())
    facts = (
        f"{len(NODES)} hosts of {SHARDS} shards; {len(SITES)} sites with {TAGS} tags each, {1 / MESSAGE_S:.0f} "
        f"messages per second and tag, the last {CACHED} in its cache. Of 100 bursts of messages, 99 left within "
        f"{fleet.late_p99_ms:.0f} ms. Of the cores, before the first failure: {busy}. While buckets moved, "
        f"{reader.of_other_sites} accepted frames of one site were of the former owner when another site already had "
        f"the new one; {reader.backwards} accepted frames had older poses than the one before."
    )
    report.record("hosts", "\n".join([*trial.table(), "", facts]))

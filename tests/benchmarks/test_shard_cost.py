"""Measure what a tag costs in a shard of a cluster, and in `dropanchor serve`.

Both get the same messages in the same seconds, each through a router of its own: the machine is not always as fast.
"""

import json
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest

from benchmarks import proc, report
from benchmarks.motion import ANCHOR, SAMPLES_PER_MESSAGE, tracks
from benchmarks.programs import Program, generator, router
from support.cluster import needs_ray, running_cluster
from support.cluster_sites import of_site
from support.postgresql import needs_postgresql, running_postgresql
from support.service import running_service
from support.zenoh_router import free_endpoint, wait_until

BUCKET = "001"
SITES, TAGS = [f"{BUCKET}.site-{number}" for number in range(4)], 600
SETTLE_S, WINDOW_S, WINDOWS = 6.0, 5.0, 6
MOST = 1.05  # times the cost in `dropanchor serve`

pytestmark = [pytest.mark.benchmark, needs_ray, needs_postgresql]


class Candidate(NamedTuple):
    """A process that serves the tags. fused: returns how many samples its estimators got."""

    process: int
    fused: Callable[[], int]


def settings_of_tags() -> list[str]:
    """Return the tables of the sites, with the start of every tag."""
    starts, lines = [track.start for track in tracks(1.0)], list[str]()
    for index, site in enumerate(SITES):
        lines += [f'[sites."{site}".site]', f'anchors = [{{ id = "{ANCHOR}" }}]']
        for tag in range(index, TAGS, len(SITES)):
            x, y, heading = starts[tag % len(starts)]
            lines += [
                f'[sites."{site}".tags.sim-{tag}]',
                f"start = {{ x = {x!r}, y = {y!r}, heading_rad = {heading!r} }}",
            ]
    return lines


def counted(statuses: Callable[[str], list[dict[str, dict[str, int]]]]) -> int:
    """Return the number of samples in the statuses of the tags of all sites."""
    return sum(count for site in SITES for status in statuses(site) for count in status["samples"].values())


@contextmanager
def shard(endpoint: str) -> Iterator[Candidate]:
    """Run a cluster with one shard until the block ends."""
    with ExitStack() as stack:
        database = stack.enter_context(running_postgresql())
        cluster = stack.enter_context(running_cluster(database, endpoint, settings_of_tags()))
        stack.push(lambda *error: print(cluster.log()) if any(error) else None)
        cluster.start("head", 12, "--head")
        wait_until(cluster.has_head, 60.0)
        cluster.start("a", 13, "--join", "--shards", "1")
        wait_until(lambda: BUCKET in cluster.owners() and cluster.address(BUCKET), 120.0)
        name = cluster.owners()[BUCKET]
        wait_until(lambda: f"{name} serves {BUCKET} " in cluster.log(), 60.0)
        fused = partial(counted, lambda site: of_site(cluster, site, "tags")["tags"])
        yield Candidate(cluster.process_of(name, BUCKET), fused)


@contextmanager
def service(endpoint: str, folder: Path) -> Iterator[Candidate]:
    """Run `dropanchor serve` with the settings of the shard until the block ends."""
    config = folder / "sites.toml"
    config.write_text("\n".join(["history.enabled = false", *settings_of_tags()]))
    arguments = ("--config", str(config), "--data-dir", str(folder), "--zenoh-connect", endpoint)
    with running_service(*arguments) as running:
        fused = partial(counted, lambda site: running.get(f"/api/v1/sites/{site}/tags")["tags"])
        yield Candidate(running.process.pid, fused)


def test_a_tag_costs_a_shard_little_more_than_a_service_of_its_own(tmp_path: Path) -> None:
    endpoints = [free_endpoint(), free_endpoint()]
    with ExitStack() as stack:
        for endpoint in endpoints:
            stack.enter_context(router(endpoint))
        candidates = [
            stack.enter_context(service(endpoints[0], tmp_path)),
            stack.enter_context(shard(endpoints[1])),
        ]
        duration_s = SETTLE_S + WINDOWS * WINDOW_S + 2.0
        fleets = [generator(endpoint, TAGS, duration_s, sites=SITES) for endpoint in endpoints]
        for fleet in fleets:
            stack.callback(fleet.end)
        cores = cores_in_use(candidates, fleets)
        sent = [json.loads(fleet.request("end"))["messages"] * SAMPLES_PER_MESSAGE for fleet in fleets]
        wait_until(lambda: [candidate.fused() for candidate in candidates] == sent)
        resident_mb = [proc.resident_bytes(candidate.process) / 1e6 for candidate in candidates]
    ratios = [of_shard / of_service for of_service, of_shard in cores]
    own, of_cluster = (statistics.median(column) for column in zip(*cores, strict=True))
    report.record(
        "shard",
        f"{TAGS} tags in {len(SITES)} sites take {own:.3f} of a core and {resident_mb[0]:.0f} MB in `dropanchor serve`,"
        f" {of_cluster:.3f} and {resident_mb[1]:.0f} MB in a shard of a cluster: "
        f"**{statistics.median(ratios):.2f} times as much** ({min(ratios):.2f} to {max(ratios):.2f} in {WINDOWS} "
        f"windows of {WINDOW_S:.0f} s). Each of {sent[0]:,} samples was used once.",
    )
    assert statistics.median(ratios) <= MOST


def cores_in_use(candidates: list[Candidate], fleets: list[Program]) -> list[tuple[float, ...]]:
    """Start the fleets at one time. Return the share of a core that each candidate takes, for each window."""
    start_ns = time.time_ns() + 300_000_000
    for fleet in fleets:
        fleet.send_line(start_ns)
    time.sleep(SETTLE_S)
    cores = []
    for _ in range(WINDOWS):
        began_s, before = time.monotonic(), [proc.thread_s(candidate.process) for candidate in candidates]
        time.sleep(WINDOW_S)
        spent_s = time.monotonic() - began_s
        after = [proc.thread_s(candidate.process) for candidate in candidates]
        cores.append(tuple((until - since) / spent_s for since, until in zip(before, after, strict=True)))
    return cores

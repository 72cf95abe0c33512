"""A head, two nodes and four shards: one node dies, the other serves all, and gives half back to a new node."""

import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from support.cluster import needs_ray, running_cluster
from support.cluster_sites import Reader, nodes_of, require_each_sample_once, settings_of_sites
from support.live_tags import LiveTags
from support.postgresql import needs_postgresql, running_postgresql
from support.zenoh_router import connected_session, wait_until

SITES = {"001.a": 5, "001.b": 6, "002.a": 7}
"""Sites and the seeds of their tags. The bucket 001 has two of them."""
TAGS = 2
BUSY_S = 240.0  # longest wait: on a busy machine Ray alone needs half a minute to start


@needs_ray
@needs_postgresql
def test_a_node_dies_and_another_comes_and_every_sample_is_used_once(
    tmp_path: Path, router_endpoint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    silences: dict[str, dict[str, float]] = {}
    reader = Reader(SITES)

    def measured(what: str, act: Callable[[], object], until: Callable[[], object]) -> None:
        began_s = time.monotonic()
        act()
        wait_until(until, BUSY_S)
        ended_s = time.monotonic()
        wait_until(lambda: reader.are_current(ended_s), BUSY_S)
        silences[what] = reader.silences_s(began_s)

    with ExitStack() as opened:
        database = opened.enter_context(running_postgresql())
        cluster = opened.enter_context(running_cluster(database, router_endpoint, settings_of_sites(SITES, TAGS)))
        opened.callback(lambda: sys.stdout.write(cluster.log()))  # shown when the test fails
        cluster.start("head", 2, "--head")
        wait_until(cluster.has_head, BUSY_S)
        cluster.start("a", 3, "--join", "--shards", "2")
        cluster.start("b", 4, "--join", "--shards", "2")
        session = opened.enter_context(connected_session(router_endpoint))
        opened.enter_context(reader.subscribed(session))
        wait_until(lambda: nodes_of(cluster) == {"a", "b"} and len(cluster.standbys()) == 2, BUSY_S)
        tags = {
            site: opened.enter_context(LiveTags(router_endpoint, TAGS, seed=seed, site=site))
            for site, seed in SITES.items()
        }
        began_s = time.monotonic()
        wait_until(lambda: reader.are_current(began_s))

        measured("node killed", lambda: cluster.kill("a"), lambda: nodes_of(cluster) == {"b"})
        again = lambda: cluster.start("a", 3, "--join", "--shards", "2")  # noqa: E731
        measured("bucket moved to a new node", again, lambda: nodes_of(cluster) == {"a", "b"})
        time.sleep(1.0)  # the former owner leaves

        require_each_sample_once(cluster, tags, tmp_path)
        wait_until(lambda: "node a: 2 shards, 1 with a bucket, 1 standing by" in cluster.run("status").stdout)
        drained = cluster.run("drain", "b")
    text = [
        f"{what}: " + ", ".join(f"{site} {s:.2f} s" for site, s in by_site.items())
        for what, by_site in silences.items()
    ]
    with capsys.disabled():
        sys.stdout.write("\n".join(["", "the longest time without a pose:", *text, ""]))
    assert drained.stdout == "b has no buckets, and gets none until it starts again.\n", drained.stderr

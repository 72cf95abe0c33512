"""A new version is installed under running nodes, and all shards run it afterwards, with every sample used once."""

import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from support.cluster import needs_ray, running_cluster
from support.cluster_sites import Reader, require_each_sample_once, settings_of_sites
from support.live_tags import LiveTags
from support.postgresql import needs_postgresql, running_postgresql
from support.zenoh_router import connected_session, wait_until

SITES = {"001.a": 5, "002.a": 7}
TAGS = 2
START_S = 240.0  # Ray is slow on a busy machine
LIMIT_S = 900.0
OLD, NEW = "7.0.0", "7.1.0"


@needs_ray
@needs_postgresql
def test_shards_are_exchanged_one_by_one_and_every_sample_is_used_once(
    tmp_path: Path, router_endpoint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    reader = Reader(SITES)
    with ExitStack() as opened:
        database = opened.enter_context(running_postgresql())
        cluster = opened.enter_context(running_cluster(database, router_endpoint, settings_of_sites(SITES, TAGS)))
        opened.callback(lambda: sys.stdout.write(cluster.log()))  # shown when the test fails
        for node in ("head", "a", "b"):
            cluster.install(node, OLD)
        cluster.start("head", 2, "--head")
        wait_until(cluster.has_head, START_S)
        cluster.start("a", 3, "--join", "--shards", "2")
        cluster.start("b", 4, "--join", "--shards", "1")
        session = opened.enter_context(connected_session(router_endpoint))
        opened.enter_context(reader.subscribed(session))
        wait_until(lambda: len(cluster.owners()) == 2 and len(cluster.standbys()) == 1, START_S)
        tags = {
            site: opened.enter_context(LiveTags(router_endpoint, TAGS, seed=seed, site=site))
            for site, seed in SITES.items()
        }
        began_s = time.monotonic()
        wait_until(lambda: reader.are_current(began_s), START_S)
        done = cluster.run("upgrade")
        assert done.stdout == f"All 3 shards run {OLD}.\n", done.stderr

        cluster.install("head", NEW)
        cluster.install("a", NEW)
        waits_on = cluster.standbys()[0].partition("/")[0]
        refused = cluster.run("upgrade").stderr
        assert f"the head runs {OLD}: on its machine, install {NEW}" in refused
        assert (f"the node b has {OLD}: install {NEW} there" in refused) == (waits_on == "b")
        cluster.stop("head")
        cluster.start("head", 2, "--head")
        wait_until(cluster.has_head, START_S)

        half_s = time.monotonic()
        stopped = cluster.run("upgrade", limit_s=LIMIT_S)
        assert stopped.returncode == 2
        assert f"the node b has {OLD}: install {NEW} there" in stopped.stderr
        cluster.install("b", NEW)
        done = cluster.run("upgrade", limit_s=LIMIT_S)
        assert done.stdout.endswith(f"All 3 shards run {NEW}.\n"), done.stdout + done.stderr
        ended_s = time.monotonic()
        wait_until(lambda: reader.are_current(ended_s), START_S)
        require_each_sample_once(cluster, tags, tmp_path)
        status = cluster.run("status").stdout
    silences = ", ".join(f"{site} {s:.2f} s" for site, s in reader.silences_s(half_s).items())
    with capsys.disabled():
        sys.stdout.write(
            f"\n{stopped.stdout}{stopped.stderr}{done.stdout}the longest time without a pose: {silences}\n"
        )
    assert status.count(f"version {NEW}") == 5  # the head, two nodes and two owners
    assert OLD not in status

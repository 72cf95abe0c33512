"""A new version is installed under running nodes, and all shards run it afterwards, with every sample used once."""

import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from support.cluster import Cluster, needs_ray, running_cluster
from support.cluster_sites import Reader, require_each_sample_once, settings_of_sites
from support.live_tags import LiveTags
from support.postgresql import needs_postgresql, running_postgresql
from support.zenoh_router import connected_session, wait_until

SITES = {"001.a": 5, "002.a": 7}
TAGS = 2
START_S = 240.0  # Ray is slow on a busy machine
LIMIT_S = 900.0
OLD, NEW = "8.1.0", "8.2.0"


def head_is_back(cluster: Cluster) -> bool:
    cluster.restart_ended()  # Ray gives up after half a minute
    return cluster.head_sees_nodes()


@pytest.mark.cluster
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
        share = tmp_path / "share"
        cluster.more = [f'checkpoints = "file://{share}"']
        for node in ("head", "a", "b"):
            cluster.install(node, OLD)
        cluster.start("head", 2, "--head")
        wait_until(cluster.has_head, START_S)
        cluster.start("a", 3, "--join", "--shards", "2")
        wait_until(lambda: len(cluster.owners()) == 2, START_S)
        cluster.start("b", 4, "--join", "--shards", "1")
        wait_until(lambda: cluster.standbys() == ["b/1"], START_S)
        session = opened.enter_context(connected_session(router_endpoint))
        opened.enter_context(reader.subscribed(session))
        tags = {
            site: opened.enter_context(LiveTags(router_endpoint, TAGS, seed=seed, site=site))
            for site, seed in SITES.items()
        }
        began_s = time.monotonic()
        wait_until(lambda: reader.are_current(began_s), START_S)
        done = cluster.run("upgrade")
        assert done.stdout == f"All 3 shards run {OLD}.\n", done.stderr

        cluster.install("head", NEW)
        refused = cluster.run("upgrade").stderr
        assert f"the head runs {OLD}: on its machine, install {NEW}" in refused
        assert f"the node b has {OLD}: install {NEW} there" in refused
        cluster.install("b", NEW)
        cluster.stop("head")
        wait_until(lambda: not cluster.head_sees_nodes())
        cluster.start("head", 2, "--head")
        wait_until(lambda: head_is_back(cluster), START_S)

        upgraded_s = time.monotonic()
        stopped = cluster.run("upgrade", limit_s=LIMIT_S)
        assert f"the node a has {OLD}: install {NEW} there" in stopped.stderr, stopped.stdout
        assert f"b/1: {OLD} -> {NEW}\n" in stopped.stdout
        assert "b/1" in cluster.owners().values()
        cluster.install("a", NEW)
        wait_until(lambda: cluster.installed_on("a") == {NEW}, START_S)
        done = cluster.run("upgrade", limit_s=LIMIT_S)
        assert done.stdout.endswith(f"All 3 shards run {NEW}.\n"), done.stdout + done.stderr
        ended_s = time.monotonic()
        wait_until(lambda: reader.are_current(ended_s), START_S)
        require_each_sample_once(cluster, tags, tmp_path)
        status = cluster.run("status").stdout
        written = {path.parent.name for path in share.glob("*/*")}
    silences = ", ".join(f"{site} {s:.2f} s" for site, s in reader.silences_s(upgraded_s).items())
    with capsys.disabled():
        sys.stdout.write(
            f"\n{stopped.stdout}{stopped.stderr}{done.stdout}the longest time without a pose: {silences}\n"
        )
    assert status.count(f"version {NEW}") == 5  # the head, two nodes and two owners
    assert OLD not in status
    assert written == {"001", "002"}

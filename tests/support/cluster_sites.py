"""Tags in sites of a cluster: their settings, their poses as a reader gets them, and what became of their samples."""

import json
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import Any, Self

import httpx
import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.epochs import EpochFence
from dropanchor_tag_client.simulator.live import start_poses, tag_name
from support.cluster import Cluster
from support.live_tags import LiveTags, distance, fused
from support.zenoh_router import wait_until


class Reader:
    """Reads the poses of all sites, and drops those of former owners."""

    def __init__(self, sites: Iterable[str]) -> None:
        self._sites = list(sites)
        self.dropped = 0  # poses of former owners
        self._fence = EpochFence()
        self._lock = Lock()
        self._times: dict[str, list[float]] = defaultdict(list)

    @contextmanager
    def subscribed(self, session: zenoh.Session) -> Iterator[Self]:
        subscriber = session.declare_subscriber(keys.all_sites("pose"), self._on_pose)
        yield self
        subscriber.undeclare()

    def _on_pose(self, message: zenoh.Sample) -> None:
        site = str(message.key_expr).split("/")[2]
        epoch = json.loads(message.payload.to_bytes())["epoch"]
        with self._lock:
            if self._fence.accepts(site, epoch):
                self._times[site].append(time.monotonic())
            else:
                self.dropped += 1

    def are_current(self, since_s: float) -> bool:
        """Return whether every site has had a pose since then."""
        with self._lock:
            return all(self._times[site] and self._times[site][-1] > since_s for site in self._sites)

    def silences_s(self, since_s: float) -> dict[str, float]:
        """Return the longest time without a pose, by site."""
        with self._lock:
            times = {site: [at_s for at_s in self._times[site] if at_s > since_s - 0.5] for site in self._sites}
        return {site: max(later - earlier for earlier, later in pairwise(at)) for site, at in times.items()}


def settings_of_sites(sites: Mapping[str, int], tags: int) -> list[str]:
    """Return the tables of the sites. sites: the seeds of their tags."""
    lines: list[str] = []
    for site, seed in sites.items():
        lines += [f'[sites."{site}".site]', 'anchors = [{ id = "1" }]']
        for index, pose in enumerate(start_poses(tags, seed)):
            start = f"{{ x = {pose.x}, y = {pose.y}, heading_rad = {pose.heading_rad} }}"
            lines += [f'[sites."{site}".tags."{tag_name(index)}"]', f"start = {start}"]
    return lines


def of_site(cluster: Cluster, site: str, what: str) -> Any:
    url = f"{cluster.address(site.partition('.')[0])}/api/v1/sites/{site}/{what}"
    return httpx.get(url, trust_env=False, verify=False).raise_for_status().json()


def poses_of_site(cluster: Cluster, site: str) -> dict[str, Any]:
    """Return the poses of a site, by tag."""
    return {pose["tag"]: pose for pose in of_site(cluster, site, "poses")["poses"]}


def all_arrived(cluster: Cluster, site: str, tags: LiveTags) -> bool:
    """Return whether the estimators got every sample once."""
    counted = {status["tag"]: status["samples"] for status in of_site(cluster, site, "tags")["tags"]}
    return counted == tags.samples


def require_each_sample_once(cluster: Cluster, tags: Mapping[str, LiveTags], folder: Path) -> None:
    """Fail unless the estimators got every sample once, and have the poses of an undisturbed run."""
    for site, of in tags.items():
        of.finish()
        wait_until(partial(all_arrived, cluster, site, of))
        expected = of.expected(of.write_settings(folder))
        answers = fused(expected, partial(poses_of_site, cluster, site))
        assert max(distance(pose, answers[tag]) for tag, pose in expected.items()) < 0.01


def nodes_of(cluster: Cluster) -> set[str]:
    """Return the nodes that own buckets."""
    return {owner.partition("/")[0] for owner in cluster.owners().values()}

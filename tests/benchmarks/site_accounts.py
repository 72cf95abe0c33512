"""Account for what the tags of many sites have sent: how much of it each estimator got, and where its track ends."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from math import inf
from typing import Any

import httpx

from benchmarks.cached_tags import MOTIONS, motion_of
from benchmarks.frame_reader import bucket_of
from benchmarks.motion import IMU_PER_MESSAGE, RANGES_PER_MESSAGE, tracks
from dropanchor_tag_client.simulator.live import tag_name
from support.cluster import Cluster
from support.cluster_sites import of_site
from support.live_tags import distance
from support.zenoh_router import wait_until

BUSY_S = 60.0  # longest wait for an answer


class Accounts:
    """Sites with so many tags each, which are numbered from site to site."""

    def __init__(self, sites: Sequence[str], tags: int) -> None:
        self.buckets = sorted(set(map(bucket_of, sites)))
        self.tags_in_all = len(sites) * tags
        self._sites = sites
        self._tags = tags
        self._starts = tracks(1.0, MOTIONS)

    def settings(self) -> Iterator[str]:
        """Yield the tables of the sites and their tags."""
        for site, first in self.first_tags().items():
            yield from (f'[sites."{site}".site]', 'anchors = [{ id = "1" }]')
            for tag in range(self._tags):
                yield f'[sites."{site}".tags."{tag_name(tag)}"]'
                yield self.start_of(first + tag)

    def first_tags(self) -> dict[str, int]:
        """Return the number of the first tag of each site."""
        return {site: index * self._tags for index, site in enumerate(self._sites)}

    def start_of(self, tag: int) -> str:
        """Return the setting of where a tag starts."""
        x, y, heading_rad = motion_of(self._starts, tag).start
        return f"start = {{ x = {x!r}, y = {y!r}, heading_rad = {heading_rad!r} }}"

    def errors(self, cluster: Cluster, messages: int) -> Counter[str]:
        """Return how many samples are missing, and how many were used too often, as "017 lost" and "017 twice"."""
        sent = {"imu": messages * IMU_PER_MESSAGE, "range": messages * RANGES_PER_MESSAGE}
        found: Counter[str] = Counter()
        for site in self._sites:
            for status in _asked(cluster, site, "tags")["tags"]:
                for kind, count in sent.items():
                    used = status["samples"].get(kind, 0)
                    found[f"{bucket_of(site)} lost"] += max(0, count - used)
                    found[f"{bucket_of(site)} twice"] += max(0, used - count)
        return +found

    def farthest_m(self, cluster: Cluster, expected: Mapping[str, Any]) -> float:
        """Return the largest distance between the pose of the first tag of a site and the one that is expected.

        It is infinite if a tag counts as lost, because samples did not come for long.
        """
        return max(_distance(expected[site], _first_pose(cluster, site)) for site in self._sites)


def _first_pose(cluster: Cluster, site: str) -> dict[str, Any]:
    poses: list[dict[str, Any]] = _asked(cluster, site, "poses")["poses"]
    return next(pose for pose in poses if pose["tag"] == tag_name(0))


def _distance(pose: Any, answer: dict[str, Any]) -> float:
    return inf if answer["x"] is None else distance(pose, answer)


def _asked(cluster: Cluster, site: str, what: str) -> Any:
    """Return what the owner of a site answers. While the bucket moves, it is asked again."""
    answers: list[Any] = []

    def has_answered() -> bool:
        with suppress(httpx.HTTPError):
            answers.append(of_site(cluster, site, what))
        return bool(answers)

    wait_until(has_answered, BUSY_S)
    return answers[0]

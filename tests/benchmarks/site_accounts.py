"""Account for what the tags of many sites have sent: how much of it each estimator got, and where its track ends."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.cached_tags import LONGEST_S, MOTIONS, motion_of, payload_of
from benchmarks.frame_reader import bucket_of
from benchmarks.motion import IMU_PER_MESSAGE, RANGES_PER_MESSAGE, tracks
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.settings.sources import load_settings
from dropanchor_tag_client.simulator.live import tag_name
from support.cluster import Cluster
from support.cluster_sites import of_site
from support.ingest import IngestBench
from support.live_tags import distance


class Accounts:
    """Sites with so many tags each, which are numbered from site to site."""

    def __init__(self, sites: Sequence[str], tags: int) -> None:
        self._sites = sites
        self._tags = tags
        self._starts = tracks(1.0, MOTIONS)

    def settings(self) -> Iterator[str]:
        """Yield the tables of the sites and their tags."""
        for index, site in enumerate(self._sites):
            yield from (f'[sites."{site}".site]', 'anchors = [{ id = "1" }]')
            for tag in range(self._tags):
                yield f'[sites."{site}".tags."{tag_name(tag)}"]'
                yield self._start(index * self._tags + tag)

    def errors(self, cluster: Cluster, messages: int) -> Counter[str]:
        """Return how many samples are missing, and how many were used too often, as "017 lost" and "017 twice"."""
        sent = {"imu": messages * IMU_PER_MESSAGE, "range": messages * RANGES_PER_MESSAGE}
        found: Counter[str] = Counter()
        for site in self._sites:
            for status in of_site(cluster, site, "tags")["tags"]:
                for kind, count in sent.items():
                    used = status["samples"].get(kind, 0)
                    found[f"{bucket_of(site)} lost"] += max(0, count - used)
                    found[f"{bucket_of(site)} twice"] += max(0, used - count)
        return +found

    def farthest_m(self, cluster: Cluster, numbers: Sequence[int], start_ns: int, folder: Path) -> float:
        """Return the largest distance between the last pose of the first tag of a site and that of a service which
        nothing disturbed. numbers: of the messages that every tag has sent."""
        expected = self._expected(numbers, start_ns, folder)
        return max(distance(expected[site], _first_pose(cluster, site)) for site in self._sites)

    def _expected(self, numbers: Sequence[int], start_ns: int, folder: Path) -> dict[str, Any]:
        firsts = {site: index * self._tags for index, site in enumerate(self._sites)}
        file = folder / "undisturbed.toml"
        tables = [line for site, tag in firsts.items() for line in (f'[tags."{site}"]', self._start(tag))]
        file.write_text("\n".join(["[[site.anchors]]", 'id = "1"', *tables]) + "\n")
        settings = load_settings(file, environment={})
        bench = IngestBench(engine=create_engine(settings), site=settings.site, tags=settings.tags)
        motions, tags = tracks(LONGEST_S, MOTIONS), len(self._sites) * self._tags
        for sequence, number in enumerate(numbers):
            for site, tag in firsts.items():
                bench.put(site, payload_of(motions, tag, tags, sequence, number, start_ns))
            bench.ingest.turn()
        return {tag.name: bench.latest.row(tag.row) for tag in bench.tags.all()}

    def _start(self, tag: int) -> str:
        x, y, heading_rad = motion_of(self._starts, tag).start
        return f"start = {{ x = {x!r}, y = {y!r}, heading_rad = {heading_rad!r} }}"


def _first_pose(cluster: Cluster, site: str) -> dict[str, Any]:
    poses: list[dict[str, Any]] = of_site(cluster, site, "poses")["poses"]
    return next(pose for pose in poses if pose["tag"] == tag_name(0))

"""Let failures happen to the hosts of a cluster, and note what a reader and the tags saw of each."""

import time
from collections import Counter
from collections.abc import Callable

from benchmarks.fleet_of_sites import FleetOfSites
from benchmarks.frame_reader import FrameReader
from benchmarks.motion import SAMPLES_PER_MESSAGE
from benchmarks.site_accounts import Accounts
from benchmarks.undisturbed import Undisturbed
from support.cluster import Cluster
from support.cluster_sites import nodes_of
from support.zenoh_router import wait_until

HEAD, NODES = 2, {"a": 3, "b": 4, "c": 5}
"""The numbers of the hosts."""
SHARDS = 2  # of each node
# Samples that are missing count as lost after this time without a change. A service asks the caches of 20 silent tags
# per second.
STABLE_S = 20.0
SETTLED_S = 1.0  # for a former owner to leave
LOOK_S = 0.2  # between two looks, which cost the database three connections each


def start_node(cluster: Cluster, node: str) -> None:
    cluster.start(node, NODES[node], "--join", "--shards", str(SHARDS))


class HostTrial:
    """errors: samples that were lost or used twice so far. farthest_m: of all poses from the undisturbed ones."""

    def __init__(
        self, cluster: Cluster, reader: FrameReader, fleet: FleetOfSites, accounts: Accounts, undisturbed: Undisturbed
    ) -> None:
        self.cluster = cluster
        self.errors: Counter[str] = Counter()
        self.farthest_m = 0.0
        self._rows: list[str] = []
        self._reader = reader
        self._fleet = fleet
        self._accounts = accounts
        self._undisturbed = undisturbed

    def table(self) -> list[str]:
        buckets = ", ".join(self._accounts.buckets)
        head = (
            f"| failure | silence of {buckets}, s | samples sent | lost | used twice | farthest pose, mm "
            "| frames of former owners: dropped | accepted |"
        )
        return [head, "|---" * 8 + "|", *self._rows]

    def begin(self) -> None:
        """Let the tags send, and wait until all is well."""
        self._fleet.go()
        self.wait_until_whole()

    def wait_until_whole(self) -> None:
        """Wait until there are news of all sites and a head, each node serves, and all other shards stand by."""
        began_s = time.monotonic()
        wait_until(lambda: self._reader.are_current(began_s), 120.0)
        wait_until(self._is_whole, 240.0)
        time.sleep(SETTLED_S)

    def _is_whole(self) -> bool:
        time.sleep(LOOK_S)
        self.cluster.restart_ended()
        owners = self.cluster.owners()
        all_serve = nodes_of(self.cluster) == set(NODES)
        return (
            all_serve and len(self.cluster.standbys()) == len(NODES) * SHARDS - len(owners) and self.cluster.has_head()
        )

    def measure(self, what: str, fail: Callable[[str, str], None]) -> None:
        """Note what came of a failure.

        fail: gets the node and the shard of the first bucket, and returns once all is mended or starts again.
        """
        self.begin()
        began_s, seen, sent = time.monotonic(), self._reader.former, len(self._fleet.numbers)
        shard = self.cluster.owners()[self._accounts.buckets[0]]
        fail(shard.partition("/")[0], shard)
        self.wait_until_whole()
        silences = self._reader.silences_s(began_s)
        self._fleet.pause()
        messages = len(self._fleet.numbers) - sent
        self._note(what, silences, messages * self._accounts.tags_in_all * SAMPLES_PER_MESSAGE, seen)

    def _note(self, what: str, silences: dict[str, float], samples: int, seen: tuple[int, int]) -> None:
        now = self._settled_errors()
        new, self.errors = now - self.errors, now
        farthest_m = self._accounts.farthest_m(self.cluster, self._undisturbed.poses_after(self._fleet.numbers))
        self.farthest_m = max(self.farthest_m, farthest_m)
        cells = [
            " / ".join(f"{silences[bucket]:.1f}" for bucket in self._accounts.buckets),
            f"{samples:,}",
            *(str(sum(count for name, count in new.items() if name.endswith(kind))) for kind in ("lost", "twice")),
            f"{1000 * farthest_m:.1f}",
            *(str(count - before) for count, before in zip(self._reader.former, seen, strict=True)),
        ]
        self._rows.append(f"| {what} | {' | '.join(cells)} |")
        print(self._rows[-1], dict(new) or "", flush=True)

    def _settled_errors(self) -> Counter[str]:
        """Return the samples that are lost or were used twice, once that does not change any longer."""
        found, since_s = self._errors(), time.monotonic()
        while found and time.monotonic() - since_s < STABLE_S:
            time.sleep(0.2)
            if (now := self._errors()) != found:
                found, since_s = now, time.monotonic()
        return found

    def _errors(self) -> Counter[str]:
        return self._accounts.errors(self.cluster, len(self._fleet.numbers))

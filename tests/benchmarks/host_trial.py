"""Let failures happen to the hosts of a cluster, and note what a reader and the tags saw of each."""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence

from benchmarks.fleet_of_sites import FleetOfSites
from benchmarks.frame_reader import FrameReader
from benchmarks.site_accounts import Accounts
from support.cluster import Cluster
from support.cluster_sites import nodes_of
from support.zenoh_router import wait_until

# Samples that are missing count as lost after this time without a change. A service asks the caches of 20 silent tags
# per second.
STABLE_S = 20.0
SETTLED_S = 3.0  # for a former owner to leave


class HostTrial:
    """rows: of a table, one for each failure. nodes: their numbers. shards: of each."""

    def __init__(
        self,
        cluster: Cluster,
        reader: FrameReader,
        fleet: FleetOfSites,
        accounts: Accounts,
        nodes: Mapping[str, int],
        shards: int,
    ) -> None:
        self.cluster = cluster
        self.rows: list[str] = []
        self.errors: Counter[str] = Counter()
        self._reader = reader
        self._fleet = fleet
        self._accounts = accounts
        self._nodes = nodes
        self._shards = shards

    def start(self, node: str) -> None:
        self.cluster.start(node, self._nodes[node], "--join", "--shards", str(self._shards))

    def wait_until_whole(self) -> None:
        """Wait until there are news of all sites and a head, each node serves, and all other shards stand by."""
        began_s = time.monotonic()
        wait_until(lambda: self._reader.are_current(began_s), 120.0)
        wait_until(self._is_whole, 240.0)
        time.sleep(SETTLED_S)

    def _is_whole(self) -> bool:
        self.cluster.restart_ended()
        owners = self.cluster.owners()
        all_serve = nodes_of(self.cluster) == set(self._nodes)
        spare = len(self._nodes) * self._shards - len(owners)
        return all_serve and len(self.cluster.standbys()) == spare and self.cluster.has_head()

    def measure(self, what: str, buckets: Sequence[str], fail: Callable[[str], None]) -> None:
        """Note what came of a failure. fail: gets the node of the first bucket, and returns once all is mended."""
        self._fleet.go()
        self.wait_until_whole()
        began_s, dropped = time.monotonic(), self._reader.dropped
        fail(self.cluster.owners()[buckets[0]].partition("/")[0])
        self.wait_until_whole()
        silences = self._reader.silences_s(began_s)
        self._fleet.pause()
        now = self._settled_errors()
        new, self.errors = now - self.errors, now
        cells = [f"{silences[bucket]:.1f}" for bucket in buckets]
        counts = [sum(count for name, count in new.items() if name.endswith(kind)) for kind in ("lost", "twice")]
        cells += [str(count) for count in (*counts, self._reader.dropped - dropped)]
        self.rows.append(f"| {what} | {' | '.join(cells)} |")
        print(self.rows[-1], dict(new) or "", flush=True)

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

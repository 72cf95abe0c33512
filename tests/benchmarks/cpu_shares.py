"""How much of the cores each kind of process takes that a trial of a cluster runs."""

import os
import time
from collections import Counter
from collections.abc import Mapping

from benchmarks.fleet_of_sites import FleetOfSites
from benchmarks.proc import cpu_s
from benchmarks.router_cell import RouterCell
from support.cluster import Cluster, descendants
from support.postgresql import Postgresql

WINDOW_S = 10.0


def shares_of_cores(cluster: Cluster, fleet: FleetOfSites, cell: RouterCell, database: Postgresql) -> dict[str, float]:
    """Return the cores that each kind of process takes during the next seconds, by its name."""
    kinds = {fleet.process: "tags", cell.process: "router", os.getpid(): "reader and accounts"}
    kinds |= dict.fromkeys(_with_descendants(database), "PostgreSQL")
    kinds |= {process: _kind_of(line) for process, line in cluster.processes().items()}
    before, began_s = _spent_s(kinds), time.monotonic()
    time.sleep(WINDOW_S)
    spent, took_s = _spent_s(kinds), time.monotonic() - began_s
    spent.subtract(before)
    return {kind: seconds / took_s for kind, seconds in spent.most_common()}


def _with_descendants(database: Postgresql) -> list[int]:
    assert database.process is not None
    return [database.process.pid, *descendants(database.process.pid)]


def _kind_of(line: str) -> str:
    return "shards" if line.startswith("ray::ShardActor") else "Ray and nodes"


def _spent_s(kinds: Mapping[int, str]) -> "Counter[str]":
    """Return the time of the processes of each kind so far. None of them ends meanwhile."""
    spent: Counter[str] = Counter()
    for process, kind in kinds.items():
        spent[kind] += cpu_s(process)  # type: ignore[assignment]
    return spent

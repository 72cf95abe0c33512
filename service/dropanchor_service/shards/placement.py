"""Where shards run and which node serves which bucket. Pure: it knows neither Ray nor the database.

Every node carries a number of shards. Those without a bucket stand by for any, so a bucket whose shard or node dies
goes on in a process that waits already.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from dropanchor_service.cluster.watch import node_of

UNEVEN = 2  # buckets by which the loads of two nodes differ before one moves


@dataclass(frozen=True)
class Node:
    """A machine that is alive. shards: how many it carries."""

    name: str
    shards: int
    is_drained: bool = False


class Move(NamedTuple):
    """A bucket, and the node whose standby is to take it over."""

    bucket: str
    to: str


@dataclass(frozen=True)
class Placement:
    """Who owns what now. owners: the shard that owns a bucket, by bucket. standbys: shards that can take one over."""

    nodes: Collection[Node]
    owners: Mapping[str, str]
    standbys: Collection[str]

    def load(self) -> Counter[str]:
        """Return the number of buckets of each node that is alive."""
        alive = {node.name for node in self.nodes}
        return Counter(node for owner in self.owners.values() if (node := node_of(owner)) in alive)

    def next_move(self) -> Move | None:
        """Return what to move: first off a node that is drained, then from a full node to an emptier one."""
        waiting = Counter(map(node_of, self.standbys))
        able = [node for node in self.nodes if not node.is_drained and waiting[node.name]]
        load = self.load()
        for bucket, owner in sorted(self.owners.items()):
            source = self._node(node_of(owner))
            if source is None:
                continue
            others = [node for node in able if node is not source]
            targets = [node for node in others if source.is_drained or _is_uneven(load, source, node)]
            if targets:
                return Move(bucket, min(targets, key=lambda node: (_share_after(load, node), node.name)).name)
        return None

    def without_standby(self) -> tuple[str, int] | None:
        """Return the node whose loss leaves most buckets without a standby, and how many; None if none does."""
        buckets = len(self.owners)
        shards = {node.name: 0 if node.is_drained else node.shards for node in self.nodes}
        worst = max(shards, key=lambda name: (shards[name], name), default=None)
        if worst is None:
            return None
        missing = buckets - (sum(shards.values()) - shards[worst])
        return (worst, missing) if missing > 0 else None

    def _node(self, name: str) -> Node | None:
        return next((node for node in self.nodes if node.name == name), None)


def _is_uneven(load: Mapping[str, int], source: Node, target: Node) -> bool:
    """Return whether a move from `source` to `target` makes their loads more even, by far enough."""
    difference = load.get(source.name, 0) - load.get(target.name, 0)
    return difference >= UNEVEN and _share_after(load, target) < load.get(source.name, 0) / source.shards


def _share_after(load: Mapping[str, int], target: Node) -> float:
    """Return the share of the shards of `target` that have a bucket after a move to it."""
    return (load.get(target.name, 0) + 1) / target.shards


def missing_shards(node: Node, running: Collection[str]) -> list[str]:
    """Return the names of the shards that a node has to carry and does not."""
    return [name for number in range(1, node.shards + 1) if (name := f"{node.name}/{number}") not in running]


class Hung:
    """Finds shards that do nothing: their lease has run out, they do not stand by, and they do not start either.

    silence_s: after which a shard hangs that was heard once. start_s: that others have until they are heard; Ray may
    list a shard whose process it never starts, if the head dies meanwhile.
    """

    def __init__(self, silence_s: float, start_s: float) -> None:
        self._silence_s = silence_s
        self._start_s = start_s
        self._due_s: dict[str, float] = {}  # when a shard has to be heard again

    def look_away(self) -> None:
        """Begin anew: while the database was away, nothing could be heard."""
        self._due_s = {}

    def find(self, running: Iterable[str], heard: Collection[str], now_s: float) -> list[str]:
        """Return the shards that hang. They count as new from then on."""
        known = set(running)
        self._due_s = {name: self._due_s.get(name, now_s + self._start_s) for name in known}
        self._due_s |= dict.fromkeys(known.intersection(heard), now_s + self._silence_s)
        found = sorted(name for name, due_s in self._due_s.items() if now_s > due_s)
        for name in found:
            del self._due_s[name]
        return found

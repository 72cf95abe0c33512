"""What to do next when the shards are to run the version that was installed under them. Pure: no I/O, no clock.

A shard that stands by ends when it is asked to, and starts again with what is installed. A shard with a bucket hands
it to one that stands by with the new version, and then starts again in the same way. One follows the other, so at
any time one shard less than usual stands by.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dropanchor_service.checkpoints import layouts
from dropanchor_service.cluster.nodes import Waiting
from dropanchor_service.cluster.watch import Lease, node_of
from dropanchor_service.shards.placement import Node, missing_shards
from dropanchor_service.shards.starting import FAILED, SENTENCE


@dataclass(frozen=True)
class Seen:
    """A cluster at one moment. head: its version, empty without one. leases: of all buckets, by bucket."""

    head: str
    nodes: Collection[Node]
    waiting: Sequence[Waiting]
    leases: Mapping[str, Lease]

    @property
    def shards(self) -> dict[str, str]:
        """The version of each shard that runs, by its name."""
        owners = {lease.owner: lease.version for lease in self.leases.values() if lease.owner}
        return {shard.name: shard.version for shard in self.waiting} | owners

    @property
    def missing(self) -> list[str]:
        """The shards that nodes carry and that do not run."""
        return [name for node in self.nodes for name in missing_shards(node, self.shards)]


class Restart(NamedTuple):
    """Ask a shard that stands by to end."""

    shard: str
    version: str


class MoveTo(NamedTuple):
    """Let a shard on this node take a bucket over."""

    bucket: str
    node: str


class Wait(NamedTuple):
    """Wait for what this sentence says."""

    sentence: str


class Stop(NamedTuple):
    """An operator has to do what this sentence says."""

    sentence: str


Step = Restart | MoveTo | Wait | Stop


def obstacles(seen: Seen, target: str) -> list[str]:
    """Return why an upgrade cannot begin, each with what to do."""
    return [
        *_of_head(seen, target),
        *_of_installations(seen, target),
        *(_unreadable(lease) for lease in seen.leases.values() if _is_unreadable(lease)),
        *_of_spares(seen, target),
    ]


def next_step(seen: Seen, target: str) -> Step | None:
    """Return what to do next, None if all shards run the target version."""
    not_installed = _of_installations(seen, target)
    if not_installed:
        return Stop(not_installed[0])
    for shard in seen.waiting:
        if shard.obstacle.startswith(FAILED):
            return Stop(f"{shard.name} {shard.obstacle.removeprefix('it ')}; its log says more")
        if shard.obstacle == SENTENCE:
            return Wait(f"{shard.name} starts")
    if seen.missing:
        return Wait(f"{seen.missing[0]} is not running yet")
    old = [shard for shard in seen.waiting if shard.version != target]
    return Restart(old[0].name, old[0].version) if old else _next_bucket(seen, target)


def _next_bucket(seen: Seen, target: str) -> Step | None:
    drained = {node.name for node in seen.nodes if node.is_drained}
    able = [shard for shard in seen.waiting if shard.node not in drained]
    for shard in able:
        if shard.obstacle:
            return Stop(f"{shard.name} runs {target} and cannot take over: {shard.obstacle}; {_accept(shard.obstacle)}")
    for bucket, lease in sorted(seen.leases.items()):
        if not lease.owner:
            return Wait(f"{bucket} has no owner")
        if lease.is_moving:
            return Wait(f"{bucket} is moving")
        if lease.version != target:
            return MoveTo(bucket, _node_for(lease, able, seen)) if able else Wait("no shard stands by")
    return None


def _node_for(lease: Lease, able: Sequence[Waiting], seen: Seen) -> str:
    """Return the node of the owner, if a shard stands by there, or the one with the fewest buckets."""
    own, nodes = node_of(lease.owner), {shard.node for shard in able}
    load = Counter(node_of(each.owner) for each in seen.leases.values())
    return own if own in nodes else min(nodes, key=lambda node: (load[node], node))


def _of_head(seen: Seen, target: str) -> list[str]:
    if not seen.head:
        return ["no head runs: start it, since nothing that ends is started again without it"]
    if seen.head != target:
        return [
            f"the head runs {seen.head}: on its machine, install {target}, then `dropanchor cluster stop` and `start`; "
            "meanwhile the shards go on"
        ]
    return []


def _of_installations(seen: Seen, target: str) -> list[str]:
    """Return what is to be installed, one sentence for each node."""
    wrong = {shard.node: shard.installed for shard in seen.waiting if target not in (shard.version, shard.installed)}
    return [f"the node {node} {_installed(text, target)}" for node, text in wrong.items()]


def _installed(text: str, target: str) -> str:
    if text.startswith(f"{target} with Ray"):
        return f"has {text}: shards cannot be exchanged under another Ray; stop all nodes, then start them"
    has = f"has {text}" if text else "does not say which version it has"
    return f"{has}: install {target} there, or exchange its container (drain, stop, start)"


def _is_unreadable(lease: Lease) -> bool:
    return bool(lease.layout) and not lease.takes_any and not layouts.may_be_read(lease.layout)


def _unreadable(lease: Lease) -> str:
    return (
        f"this version does not read the checkpoint of {lease.bucket} (layout {lease.layout}): upgrade to a version "
        f"between them first, or run `dropanchor cluster accept {lease.bucket}`: its tags then start afresh"
    )


def _of_spares(seen: Seen, target: str) -> list[str]:
    if all(version == target for version in seen.shards.values()):
        return []
    drained = {node.name for node in seen.nodes if node.is_drained}
    if any(shard.node not in drained for shard in seen.waiting):
        return []
    return ["no shard stands by, so none can take a bucket over: start a node, or one with more --shards"]


def _accept(obstacle: str) -> str:
    bucket = obstacle.partition(":")[0]
    return f"`dropanchor cluster accept {bucket}` lets it, if that is meant"

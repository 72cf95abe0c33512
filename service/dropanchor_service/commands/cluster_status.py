"""What `dropanchor cluster status` prints."""

from collections import Counter

from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import Connection
from dropanchor_service.cluster.leases import HEAD, HEAD_SEEN_S, BucketStatus
from dropanchor_service.cluster.nodes import NodeRow, Waiting
from dropanchor_service.cluster.watch import Lease, node_of


def status_text(connection: Connection) -> str:
    """Return the head, the nodes and the buckets, as lines for people."""
    buckets = leases.status(connection)
    lines = [*_of_nodes(connection, [each.lease for each in buckets]), *map(_of_bucket, buckets)]
    return "\n".join(lines) or "there are no buckets yet: no process has been started"


def _of_nodes(connection: Connection, held: list[Lease]) -> list[str]:
    head, rows, shards = leases.read(connection, HEAD), nodes.read(connection), nodes.waiting(connection)
    if head is None:
        return []
    gone = "" if leases.has_head(connection) else f", last seen {head.age_s:.0f} s ago"
    owned, waiting = Counter(node_of(lease.owner) for lease in held), Counter(shard.node for shard in shards)
    unable = [f"  {shard.name} cannot take over: {shard.obstacle}" for shard in shards if shard.obstacle]
    versions = sorted([(lease.owner, lease.version) for lease in held] + [(each.name, each.version) for each in shards])
    first = f"head: {head.owner or 'none'}{f' at {head.address}' if head.owner else ''}{gone}"
    lines = [
        _of_node(row, owned[row.name], waiting[row.name]) + _versions(row.name, versions, shards)
        for row in rows
        if row.shards
    ]
    return [first + (f", version {head.version}" if head.version else ""), *lines, *unable]


def _versions(node: str, versions: list[tuple[str, str]], waiting: list[Waiting]) -> str:
    """Return the versions of the shards of a node, and the one that is installed there if another runs."""
    own = {name: version for name, version in versions if node_of(name) == node and version}
    installed = {shard.installed for shard in waiting if shard.node == node} - set(own.values()) - {""}
    each = ", ".join(f"{name} {version}" for name, version in own.items())
    runs = each if len(set(own.values())) > 1 else "".join(set(own.values()))
    return "".join([f", version {runs}" if runs else "", *(f", {version} is installed" for version in installed)])


def _of_node(row: NodeRow, owned: int, waiting: int) -> str:
    drained = ", drained" if row.is_drained else ""
    gone = f", last seen {row.age_s:.0f} s ago" if row.age_s > HEAD_SEEN_S else ""
    return f"node {row.name}: {row.shards} shards, {owned} with a bucket, {waiting} standing by{drained}{gone}"


def _of_bucket(status: BucketStatus) -> str:
    lease = status.lease
    address = f" at {lease.address}" if lease.address else ""
    version = f", version {lease.version}" if lease.version else ""
    owner = f"{lease.owner}{address}{version}, lease renewed {lease.age_s:.1f} s ago" if lease.owner else "nobody"
    size = f"{status.checkpoint_bytes / 1e6:.2f} MB, {status.checkpoint_age_s:.1f} s old"
    lines = [
        f"{lease.bucket}: epoch {lease.epoch}",
        f"  owner: {owner}",
        f"  checkpoint: {size if status.checkpoint_bytes else 'none'}",
        f"  standbys: {', '.join(status.standbys) or 'none'}",
    ]
    if "/" in lease.owner:
        lines.pop()  # every shard that stands by does so for all buckets
    if lease.takes_any:
        lines.append("  the next owner may have other settings of sites or another version")
    return "\n".join(lines)

"""What `dropanchor cluster status` prints."""

from collections import Counter

from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import Connection
from dropanchor_service.cluster.leases import HEAD, HEAD_SEEN_S, BucketStatus
from dropanchor_service.cluster.nodes import NodeRow
from dropanchor_service.cluster.watch import node_of


def status_text(connection: Connection) -> str:
    """Return the head, the nodes and the buckets, as lines for people."""
    buckets = leases.status(connection)
    owners = [each.lease.owner for each in buckets]
    lines = [*_of_nodes(connection, owners), *map(_of_bucket, buckets)]
    return "\n".join(lines) or "there are no buckets yet: no process has been started"


def _of_nodes(connection: Connection, owners: list[str]) -> list[str]:
    head, rows, standbys = leases.read(connection, HEAD), nodes.read(connection), nodes.standbys(connection)
    if head is None:
        return []
    gone = "" if leases.has_head(connection) else f", last seen {head.age_s:.0f} s ago"
    owned, waiting = Counter(map(node_of, owners)), Counter(map(node_of, standbys))
    unable = [f"  {name} cannot take over: {why_not}" for name, why_not in standbys.items() if why_not]
    first = f"head: {head.owner or 'none'}{f' at {head.address}' if head.owner else ''}{gone}"
    return [first, *(_of_node(row, owned[row.name], waiting[row.name]) for row in rows if row.shards), *unable]


def _of_node(row: NodeRow, owned: int, waiting: int) -> str:
    drained = ", drained" if row.is_drained else ""
    gone = f", last seen {row.age_s:.0f} s ago" if row.age_s > HEAD_SEEN_S else ""
    return f"node {row.name}: {row.shards} shards, {owned} with a bucket, {waiting} standing by{drained}{gone}"


def _of_bucket(status: BucketStatus) -> str:
    lease = status.lease
    address = f" at {lease.address}" if lease.address else ""
    owner = f"{lease.owner}{address}, lease renewed {lease.age_s:.1f} s ago" if lease.owner else "nobody"
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

"""The table of leases: each statement either succeeds as a whole or changes nothing."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

from dropanchor_service.cluster.database import Connection
from dropanchor_service.cluster.watch import Lease, node_of

_COLUMNS = """
    lease.bucket, greatest(lease.epoch, coalesce(checkpoint.epoch, 0)), lease.owner, lease.address, lease.sites,
    coalesce(checkpoint.layout, ''), lease.renewals, lease.is_moving, lease.moving_to,
    lease.was_moved, lease.takes_any, lease.lease_s,
    extract(epoch FROM clock_timestamp() - lease.renewed)::double precision, lease.version
"""
_SELECT = f"""
    SELECT {_COLUMNS} FROM dropanchor_lease AS lease LEFT JOIN dropanchor_checkpoint AS checkpoint USING (bucket)
"""
_CLAIM = """
    UPDATE dropanchor_lease SET epoch = %(next)s, owner = %(owner)s, address = %(address)s, sites = %(sites)s,
        version = %(version)s,
        renewals = 0, lease_s = %(lease_s)s, was_moved = is_moving, is_moving = false, moving_to = '',
        takes_any = false, renewed = clock_timestamp()
    WHERE bucket = %(bucket)s AND epoch <= %(epoch)s AND renewals = %(renewals)s AND owner = %(seen_owner)s
"""
_FENCE = """
    INSERT INTO dropanchor_checkpoint (bucket, epoch) VALUES (%(bucket)s, %(next)s)
    ON CONFLICT (bucket) DO UPDATE SET epoch = excluded.epoch RETURNING content, object
"""
_FENCE_DOCUMENTS = """
    UPDATE dropanchor_document SET epoch = %(next)s WHERE bucket = %(bucket)s RETURNING name, content
"""
_RENEW = """
    UPDATE dropanchor_lease SET renewals = renewals + 1, renewed = clock_timestamp() WHERE bucket = %s AND epoch = %s
"""
_RELEASE = """
    UPDATE dropanchor_lease SET owner = '', address = '', renewals = renewals + 1 WHERE bucket = %s AND epoch = %s
"""
_ADDRESS = "UPDATE dropanchor_lease SET address = %s WHERE bucket = %s AND epoch = %s"
_MOVE = "UPDATE dropanchor_lease SET is_moving = %s, moving_to = %s WHERE bucket = %s"
_STANDBY = """
    INSERT INTO dropanchor_standby (bucket, name, obstacle, version, installed) VALUES (%s, %s, %s, %s, %s)
    ON CONFLICT (bucket, name) DO UPDATE SET obstacle = excluded.obstacle, version = excluded.version,
        installed = excluded.installed, seen = clock_timestamp()
"""
_STATUS = """
    SELECT bucket, coalesce(nullif(octet_length(content), 0), bytes, 0),
        coalesce(extract(epoch FROM clock_timestamp() - written)::double precision, 0),
        ARRAY(SELECT name || CASE obstacle WHEN '' THEN '' ELSE ' (cannot take over: ' || obstacle || ')' END
              FROM dropanchor_standby WHERE bucket = lease.bucket AND name <> lease.owner
              AND seen > clock_timestamp() - interval '5 s' ORDER BY name)
    FROM dropanchor_lease AS lease LEFT JOIN dropanchor_checkpoint USING (bucket) ORDER BY bucket
"""
ANY = "*"
"""The bucket of a standby that takes over any."""
HEAD = "@head"
"""The bucket that has no sites: its owner looks after the nodes and shards of the cluster."""
HEAD_SEEN_S = 10.0  # since the last renewal, after which the head is taken for gone


@dataclass(frozen=True)
class Claimant:
    """Who claims.

    sites: digest of its settings of the sites. address: for clients; empty when it is not known. version: that it runs.
    """

    name: str
    address: str
    sites: str
    lease_s: float
    version: str = ""


@dataclass(frozen=True)
class Claim:
    """What a new owner has.

    checkpoint: its bytes, empty if the database has none. documents: what people have changed, by name. object: name of
    the checkpoint where checkpoints are objects; it counts only if `checkpoint` is empty. was_moved: the former owner
    serves until its successor has caught up.
    """

    epoch: int
    checkpoint: bytes
    documents: dict[str, bytes]
    object: str = ""
    was_moved: bool = False


class Claimed(NamedTuple):
    """A claim, and when it was asked for, by the clock of leases."""

    claim: Claim
    asked_s: float


@dataclass(frozen=True)
class BucketStatus:
    """A bucket, for people. standbys: those that were seen in the last seconds, each with its obstacle."""

    lease: Lease
    checkpoint_bytes: int
    checkpoint_age_s: float
    standbys: Sequence[str]


def read(connection: Connection, bucket: str) -> Lease | None:
    """Return the lease of a bucket, None if it has none. Its epoch is the highest that anybody had of it."""
    row = connection.execute(f"{_SELECT} WHERE bucket = %s", [bucket]).fetchone()
    return None if row is None else _lease(row)


def read_all(connection: Connection) -> dict[str, Lease]:
    """Return the leases of all buckets of sites, by bucket."""
    found = map(_lease, connection.execute(f"{_SELECT} WHERE bucket <> %s", [HEAD]))
    return {lease.bucket: lease for lease in found}


def seen_or_new(connection: Connection, bucket: str) -> Lease:
    """Return the lease of a bucket. One that has none gets one without an owner."""
    found = read(connection, bucket)
    if found is not None:
        return found
    connection.execute("INSERT INTO dropanchor_lease (bucket) VALUES (%s) ON CONFLICT DO NOTHING", [bucket])
    return read(connection, bucket) or Lease(bucket)


def claim(connection: Connection, seen: Lease, who: Claimant) -> Claim | None:
    """Take over a bucket with the next epoch, unless its lease is no longer the one that was seen; then return None.

    From then on the former owner can write neither its checkpoint nor its documents.
    """
    values = {
        "bucket": seen.bucket,
        "epoch": seen.epoch,
        "next": seen.epoch + 1,
        "renewals": seen.renewals,
        "seen_owner": seen.owner,
        "owner": who.name,
        "address": who.address,
        "sites": who.sites,
        "lease_s": who.lease_s,
        "version": who.version,
    }
    with connection.transaction():
        connection.execute("SET LOCAL synchronous_commit = on")
        if connection.execute(_CLAIM, values).rowcount != 1:
            return None
        row = connection.execute(_FENCE, values, binary=True).fetchone()
        assert row is not None
        connection.execute("DELETE FROM dropanchor_standby WHERE name = %s", [who.name])
        documents = {name: bytes(text) for name, text in connection.execute(_FENCE_DOCUMENTS, values, binary=True)}
    return Claim(seen.epoch + 1, bytes(row[0]), documents, row[1], seen.is_moving)


def renew(connection: Connection, bucket: str, epoch: int) -> bool:
    """Renew the lease. Return whether it is still of this epoch."""
    return connection.execute(_RENEW, [bucket, epoch]).rowcount == 1


def release(connection: Connection, bucket: str, epoch: int) -> None:
    """Give the bucket back, so that a standby takes over at once."""
    connection.execute(_RELEASE, [bucket, epoch])


def set_address(connection: Connection, bucket: str, epoch: int, address: str) -> None:
    """Write where clients reach the owner, which was not known when it claimed the bucket."""
    connection.execute(_ADDRESS, [address, bucket, epoch])


def note_standby(
    connection: Connection, bucket: str, name: str, obstacle: str | None, version: str = "", installed: str = ""
) -> None:
    """Write that a standby is there. version: that it runs. installed: that it would run after a new start."""
    connection.execute(_STANDBY, [bucket, name, obstacle or "", version, installed])


def set_moving(connection: Connection, bucket: str, is_moving: bool, to: str = "") -> None:
    """Let the next standby take the bucket over at once, or no longer. to: its node, if not any."""
    connection.execute(_MOVE, [is_moving, to, bucket])


def owned_by_node(connection: Connection, node: str) -> list[str]:
    """Return the buckets that the shards of a node own, by name."""
    owners = ((lease.bucket, lease.owner) for lease in read_all(connection).values())
    return sorted(bucket for bucket, owner in owners if owner and node_of(owner) == node)


def has_head(connection: Connection) -> bool:
    """Return whether a head looks after the nodes."""
    lease = read(connection, HEAD)
    return lease is not None and bool(lease.owner) and lease.age_s < HEAD_SEEN_S


def accept_any(connection: Connection, bucket: str) -> None:
    """Let the next owner have other settings of sites, or another layout of checkpoints."""
    connection.execute("UPDATE dropanchor_lease SET takes_any = true WHERE bucket = %s", [bucket])


def status(connection: Connection) -> list[BucketStatus]:
    """Return all buckets of sites, in the order of their names."""
    leases = read_all(connection)
    rows = connection.execute(_STATUS).fetchall()
    return [BucketStatus(leases[row[0]], *row[1:]) for row in rows if row[0] in leases]


def _lease(row: Sequence[object]) -> Lease:
    names = [field.name for field in fields(Lease)]
    return Lease(**dict(zip(names, row, strict=True)))  # type: ignore[arg-type]

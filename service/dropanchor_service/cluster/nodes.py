"""The table of the nodes of a cluster, and the shards on them that stand by."""

from dataclasses import dataclass

from dropanchor_service.cluster.database import Connection
from dropanchor_service.cluster.leases import ANY
from dropanchor_service.cluster.watch import node_of

_NOTE = """
    INSERT INTO dropanchor_node (name, shards) VALUES (%s, %s)
    ON CONFLICT (name) DO UPDATE SET shards = excluded.shards, seen = clock_timestamp()
"""
_DRAIN = """
    INSERT INTO dropanchor_node (name, is_drained) VALUES (%s, %s)
    ON CONFLICT (name) DO UPDATE SET is_drained = excluded.is_drained
"""
_READ = """
    SELECT name, shards, is_drained, extract(epoch FROM clock_timestamp() - seen)::double precision
    FROM dropanchor_node ORDER BY name
"""
_STANDBYS = """
    SELECT name, obstacle FROM dropanchor_standby WHERE bucket = %s AND seen > clock_timestamp() - interval '5 s'
    AND name NOT IN (SELECT owner FROM dropanchor_lease) ORDER BY name
"""
_SHARDS = """
    SELECT name, obstacle, version, installed FROM dropanchor_standby
    WHERE bucket = %s AND seen > clock_timestamp() - interval '5 s'
    AND name NOT IN (SELECT owner FROM dropanchor_lease) ORDER BY name
"""
_ASK_TO_END = "UPDATE dropanchor_standby SET has_to_end = %s WHERE bucket = %s AND name = %s"
_END = "DELETE FROM dropanchor_standby WHERE bucket = %s AND name = %s AND has_to_end"


@dataclass(frozen=True)
class NodeRow:
    """A node. shards: how many it carries. age_s: since the head saw it alive, by the clock of the database."""

    name: str
    shards: int
    is_drained: bool
    age_s: float


@dataclass(frozen=True)
class Waiting:
    """A shard that stands by or starts.

    obstacle: why it cannot take over; empty if it can. version: that it runs. installed: that it would run after a new
    start.
    """

    name: str
    obstacle: str
    version: str
    installed: str

    @property
    def node(self) -> str:
        """The node that carries it."""
        return node_of(self.name)


def note(connection: Connection, name: str, shards: int) -> None:
    """Write that a node is alive."""
    connection.execute(_NOTE, [name, shards])


def set_drained(connection: Connection, name: str, is_drained: bool) -> None:
    """Let the shards of a node take over no bucket, or again."""
    connection.execute(_DRAIN, [name, is_drained])


def read(connection: Connection) -> list[NodeRow]:
    """Return all nodes that there ever were, by name."""
    return [NodeRow(*row) for row in connection.execute(_READ)]


def is_drained(connection: Connection, name: str) -> bool:
    """Return whether the shards of this node must not take over."""
    row = connection.execute("SELECT is_drained FROM dropanchor_node WHERE name = %s", [name]).fetchone()
    return row is not None and bool(row[0])


def standbys(connection: Connection) -> dict[str, str]:
    """Return the shards that stand by for any bucket, each with its obstacle, which is empty if it can take over."""
    return dict(connection.execute(_STANDBYS, [ANY]).fetchall())


def waiting(connection: Connection) -> list[Waiting]:
    """Return the shards that stand by or start, by name."""
    return [Waiting(*row) for row in connection.execute(_SHARDS, [ANY])]


def ask_to_end(connection: Connection, shard: str, asks: bool = True) -> None:
    """Ask a shard to end once it stands by, so that it starts again. asks: False takes the request back."""
    connection.execute(_ASK_TO_END, [asks, ANY, shard])


def has_to_end(connection: Connection, shard: str) -> bool:
    """Return whether a shard was asked to end. Then it stands by no longer, and the request is done."""
    return connection.execute(_END, [ANY, shard]).rowcount == 1

"""When a standby may take over. Pure: no I/O, and no clock but the one that is passed in."""

from dataclasses import dataclass

from dropanchor_schemas.sentences import say
from dropanchor_service.checkpoints import layouts


@dataclass(frozen=True)
class Lease:
    """A row of the table of leases.

    owner: empty when nobody owns the bucket. sites: digest of the owner's settings of its sites. layout: of the newest
    checkpoint; empty when there is none. renewals: count of the current owner. is_moving: the next standby may take
    over at once; moving_to: only one on this node, if it is not empty. was_moved: the owner became it that way.
    takes_any: the next owner may have other sites or another layout. lease_s: of the owner. age_s: since the last
    renewal, by the clock of the database; for people. version: that the owner runs.
    """

    bucket: str
    epoch: int = 0
    owner: str = ""
    address: str = ""
    sites: str = ""
    layout: str = ""
    renewals: int = 0
    is_moving: bool = False
    moving_to: str = ""
    was_moved: bool = False
    takes_any: bool = False
    lease_s: float = 0.0
    age_s: float = 0.0
    version: str = ""


HELD = 2.0  # times its length: an older lease has run out


def is_held(lease: Lease) -> bool:
    """Return whether somebody owns the bucket and renews its lease, by the clock of the database."""
    return lease.owner != "" and lease.age_s < HELD * lease.lease_s


def node_of(owner: str) -> str:
    """Return the node of an owner: shards are named after theirs, such as `machine-1/3`."""
    return owner.partition("/")[0]


class Watch:
    """Watches a lease by what changes in it, not by the time in it: clocks of machines may be hours apart.

    A lease has ended when it has not changed for as long as it lasts, while this process looked all the time.
    """

    def __init__(self, lease_s: float, name: str = "") -> None:
        """name: of the standby that watches."""
        self._lease_s = lease_s
        self._node = node_of(name)
        self._seen: tuple[int, int] | None = None  # epoch and renewals
        self._since_s = 0.0
        self._looked_s = 0.0

    def may_claim(self, lease: Lease, now_s: float) -> bool:
        """Look at the lease, and return whether a standby may claim it. now_s: of a clock that nobody sets."""
        seen = (lease.epoch, lease.renewals)
        looked_away = now_s - self._looked_s > self._lease_s
        if seen != self._seen or looked_away:
            self._seen, self._since_s = seen, now_s
        self._looked_s = now_s
        ended = now_s - self._since_s > max(self._lease_s, lease.lease_s)
        moves_here = lease.is_moving and lease.moving_to in ("", self._node)
        return lease.owner == "" or moves_here or ended

    def look_away(self) -> None:
        """Begin anew: while the database was away, the owner could not renew its lease either."""
        self._seen = None


def obstacle(lease: Lease, sites: str, layout: str) -> str | None:
    """Return why a standby with these sites cannot take over, None if it can.

    layout: of the checkpoints that it writes; it reads those before it, too.
    """
    if lease.takes_any:
        return None
    if lease.sites not in ("", sites):
        return say("other_sites", "its settings of sites and tags are not those of the owner")
    why_unreadable = layouts.why_unreadable(lease.layout, layout) if lease.layout else None
    if why_unreadable is None:
        return None
    return say("other_layout", "the checkpoint has the layout {why}", why=why_unreadable)

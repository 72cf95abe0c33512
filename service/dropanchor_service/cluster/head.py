"""The lease of the head, which looks after nodes and shards, and what nodes must have in common with it."""

import logging
import time
from importlib.metadata import version

from dropanchor_service.cluster import leases
from dropanchor_service.cluster.boot_clock import boot_s
from dropanchor_service.cluster.database import Connection
from dropanchor_service.cluster.leases import HEAD, Claimant
from dropanchor_service.cluster.watch import Lease, Watch

LEASE_S = 3.0
LOOK_S = 0.1

_log = logging.getLogger(__name__)


class HeadError(ValueError):
    """This process cannot be a node or the head; the message says why."""


class NoHeadError(HeadError):
    """There is no head to join."""


def fingerprint(sites: str) -> str:
    """Return what all nodes must have in common: the version, and the digest of the settings of all sites."""
    return f"{version('dropanchor-service')} {sites}"


def free_lease(connection: Connection) -> Lease:
    """Return the lease of the head, once the last head certainly does not run. Raises HeadError if one does."""
    watch = Watch(LEASE_S)
    first = leases.seen_or_new(connection, HEAD)
    while True:
        lease, now_s = leases.seen_or_new(connection, HEAD), boot_s()
        if (lease.epoch, lease.renewals) != (first.epoch, first.renewals) and lease.owner:
            raise _taken(lease)
        if watch.may_claim(lease, now_s):
            return lease
        time.sleep(LOOK_S)


def become_head(connection: Connection, free: Lease, name: str, address: str, sites: str) -> int:
    """Claim the lease of the head and return its epoch. Raises HeadError if it has changed since it was free."""
    who = Claimant(name, address, fingerprint(sites), LEASE_S, version("dropanchor-service"))
    claim = leases.claim(connection, free, who)
    if claim is None:
        raise _taken(leases.seen_or_new(connection, HEAD))
    return claim.epoch


def head_to_join(connection: Connection, sites: str, limit_s: float) -> Lease:
    """Return the lease of the head, as `head_of` does, and wait for a head that starts. Raises HeadError."""
    end_s, said = time.monotonic() + limit_s, False
    while True:
        try:
            return head_of(connection, sites)
        except NoHeadError:
            if time.monotonic() > end_s:
                raise
        if not said:
            _log.info("no head runs yet: waiting for it")
        said = True
        time.sleep(LOOK_S)


def _taken(lease: Lease) -> HeadError:
    return HeadError(f"{lease.owner} is the head of this cluster, at {lease.address}: --join it")


def head_of(connection: Connection, sites: str) -> Lease:
    """Return the lease of the head, if a node with these sites can join it. Raises HeadError, also NoHeadError."""
    lease = leases.read(connection, HEAD)
    if lease is None or not leases.has_head(connection):
        raise NoHeadError("no head runs: start one with `dropanchor cluster start --head`")
    theirs, _, digest = lease.sites.partition(" ")
    ours = fingerprint(sites).partition(" ")[0]
    if theirs != ours:
        raise HeadError(f"the head {lease.owner} has version {theirs}, this machine {ours}: install the same")
    if digest != sites:
        raise HeadError(f"the settings of sites and tags are not those of the head {lease.owner}: make them equal")
    return lease

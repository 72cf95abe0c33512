"""The lease of the head, which looks after nodes and shards, and what nodes must have in common with it."""

import time
from importlib.metadata import version

from dropanchor_service.cluster import leases
from dropanchor_service.cluster.boot_clock import boot_s
from dropanchor_service.cluster.database import Connection
from dropanchor_service.cluster.leases import HEAD, Claimant
from dropanchor_service.cluster.watch import Lease, Watch

LEASE_S = 3.0
LOOK_S = 0.1


class HeadError(ValueError):
    """This process cannot be a node or the head; the message says why."""


def fingerprint(sites: str) -> str:
    """Return what all nodes must have in common: the version, and the digest of the settings of all sites."""
    return f"{version('dropanchor-service')} {sites}"


def become_head(connection: Connection, name: str, address: str, sites: str) -> int:
    """Claim the lease of the head and return its epoch. Wait while the last head may run. Raises HeadError."""
    watch = Watch(LEASE_S)
    first = leases.seen_or_new(connection, HEAD)
    who = Claimant(name, address, fingerprint(sites), LEASE_S, version("dropanchor-service"))
    while True:
        lease, now_s = leases.seen_or_new(connection, HEAD), boot_s()
        if (lease.epoch, lease.renewals) != (first.epoch, first.renewals) and lease.owner:
            raise HeadError(f"{lease.owner} is the head of this cluster, at {lease.address}: --join it")
        if watch.may_claim(lease, now_s):
            claim = leases.claim(connection, lease, who)
            if claim is not None:
                return claim.epoch
        time.sleep(LOOK_S)


def head_of(connection: Connection, sites: str) -> Lease:
    """Return the lease of the head, if a node with these sites can join it. Raises HeadError."""
    lease = leases.read(connection, HEAD)
    if lease is None or not leases.has_head(connection):
        raise HeadError("no head runs: start one with `dropanchor cluster start --head`")
    theirs, _, digest = lease.sites.partition(" ")
    ours = fingerprint(sites).partition(" ")[0]
    if theirs != ours:
        raise HeadError(f"the head {lease.owner} has version {theirs}, this machine {ours}: install the same")
    if digest != sites:
        raise HeadError(f"the settings of sites and tags are not those of the head {lease.owner}: make them equal")
    return lease

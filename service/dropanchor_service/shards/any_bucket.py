"""Wait until this process may serve any bucket of the cluster."""

import hashlib
import logging
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.boot_clock import boot_s
from dropanchor_service.cluster.database import Connection, DatabaseError, make_tables, sentence_of
from dropanchor_service.cluster.leases import ANY, Claimant, Claimed
from dropanchor_service.cluster.versions import installed
from dropanchor_service.cluster.watch import Lease, Watch, node_of, obstacle

LOOK_S = 0.1
BUCKETS_PER_LOOK_S = 500  # that one standby reads; with more than 50 buckets it looks less often
NOTE_S = 1.0
RETRY_S = 0.5

_log = logging.getLogger(__name__)


class Owned(NamedTuple):
    """A bucket that this process owns now."""

    bucket: str
    claimed: Claimed


class AskedToEndError(Exception):
    """Somebody has asked this shard to end, so that it starts again with the version that is installed."""


class AnyStandby:
    """Looks at the leases of all buckets until it can claim one.

    connect: raises DatabaseError. claimants: what to claim each bucket with; they all have the same name and version.
    layout: of the checkpoints that this version reads.
    """

    def __init__(self, connect: Callable[[], Connection], claimants: Mapping[str, Claimant], layout: str) -> None:
        self._connect = connect
        self._claimants = claimants
        self._layout = layout
        self._name, self._version = next((who.name, who.version) for who in claimants.values())
        self._look_s = max(LOOK_S, len(claimants) / BUCKETS_PER_LOOK_S)
        self._order = sorted(claimants, key=self._preference)
        self._watches = {bucket: Watch(who.lease_s, who.name) for bucket, who in claimants.items()}
        self._drained = False
        self._noted_s = 0.0

    def wait(self) -> Owned:
        """Return the bucket that was claimed. Raises AskedToEndError."""
        said = ""
        while True:
            try:
                with self._connect() as connection:
                    make_tables(connection)
                    for bucket in self._claimants:
                        leases.seen_or_new(connection, bucket)
                    said = ""
                    return self._watched(connection)
            except DatabaseError as error:
                for watch in self._watches.values():
                    watch.look_away()
                if said != (said := sentence_of(error)):
                    _log.warning("standing by, but the database does not answer: %s", said)
                time.sleep(RETRY_S)

    def _watched(self, connection: Connection) -> Owned:
        while True:
            found, now_s = leases.read_all(connection), boot_s()
            whys = {bucket: self._obstacle(found[bucket]) for bucket in self._order if bucket in found}
            if now_s - self._noted_s > NOTE_S:  # also before the first claim: the node may be drained
                self._noted_s = now_s
                self._note(connection, whys)
            for bucket, why_not in whys.items():
                may = self._watches[bucket].may_claim(found[bucket], now_s)
                if may and why_not is None and not self._drained:
                    claim = leases.claim(connection, found[bucket], self._claimants[bucket])
                    if claim is not None:
                        return Owned(bucket, Claimed(claim, now_s))
            time.sleep(self._look_s)

    def _note(self, connection: Connection, whys: Mapping[str, str | None]) -> None:
        self._drained = nodes.is_drained(connection, node_of(self._name))
        found = [f"{bucket}: {why_not}" for bucket, why_not in sorted(whys.items()) if why_not is not None]
        why = "its node is drained" if self._drained else found[0] if found else None
        leases.note_standby(connection, ANY, self._name, why, self._version, installed())
        if nodes.has_to_end(connection, self._name):
            raise AskedToEndError

    def _obstacle(self, lease: Lease) -> str | None:
        return obstacle(lease, self._claimants[lease.bucket].sites, self._layout)

    def _preference(self, bucket: str) -> bytes:
        """Return a key that orders the buckets in each process differently, so that standbys seldom want the same."""
        return hashlib.blake2b(f"{self._name} {bucket}".encode(), digest_size=8).digest()

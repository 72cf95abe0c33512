"""Let a standby take a bucket over, and wait until it has."""

import time

from dropanchor_service.cluster import leases
from dropanchor_service.cluster.database import Connection
from dropanchor_service.cluster.watch import Lease

POLL_S = 0.05


def moved(connection: Connection, former: Lease, node: str, limit_s: float) -> Lease | None:
    """Return the lease of the next owner of a bucket; None if no standby took it over within the limit.

    former: its lease before. node: of the standby; empty for any.
    """
    leases.set_moving(connection, former.bucket, True, node)
    end_s = time.monotonic() + limit_s
    while time.monotonic() < end_s:
        lease = leases.read(connection, former.bucket)
        if lease is not None and lease.epoch > former.epoch:
            return lease
        time.sleep(POLL_S)
    leases.set_moving(connection, former.bucket, False)
    return None

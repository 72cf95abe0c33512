"""Read the table of leases, again and again."""

import asyncio
import logging
import time
from contextlib import suppress

from dropanchor_service.cluster import leases
from dropanchor_service.cluster.database import Connection, DatabaseError, connect, sentence_of
from dropanchor_service.node.owners import Owner, Owners

PERIOD_S = 0.25
LEAST_S = 0.05

_log = logging.getLogger(__name__)


class LeasesSeen:
    """Tells `owners` what the table says. problem: why the newest reading failed, None if it did not.

    While the database is away, the owners that were seen last stay: nobody can take over without it.
    """

    def __init__(self, url: str, owners: Owners) -> None:
        self._url = url
        self._owners = owners
        self._connection: Connection | None = None
        self._asked = asyncio.Event()
        self._read_s: float | None = None
        self.problem: str | None = None

    @property
    def age_s(self) -> float | None:
        """The time since the table was read; None if it never was."""
        return None if self._read_s is None else time.monotonic() - self._read_s

    def look(self) -> None:
        """Read the table soon, because an owner did not answer."""
        self._asked.set()

    async def run(self) -> None:
        """Read until this is cancelled."""
        try:
            while True:
                await self._read_once()
                self._asked.clear()
                await asyncio.sleep(LEAST_S)
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._asked.wait(), PERIOD_S - LEAST_S)
        finally:
            self._disconnect()

    async def _read_once(self) -> None:
        began_s = time.monotonic()
        try:
            found = await asyncio.to_thread(self._read)
        except DatabaseError as error:
            if self.problem is None:
                _log.warning("the table of leases cannot be read: %s", sentence_of(error))
            self.problem = sentence_of(error)
            self._disconnect()
        else:
            if self.problem is not None:
                _log.info("the database answers again")
            self.problem, self._read_s = None, began_s
            self._owners.take(found)

    def _read(self) -> list[Owner]:
        if self._connection is None:
            self._connection = connect(self._url, "api")
        found = leases.read_all(self._connection).values()
        return [Owner(lease.bucket, lease.epoch, lease.owner, lease.address) for lease in found]

    def _disconnect(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

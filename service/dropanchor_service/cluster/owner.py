"""Keep the lease of a bucket while this process serves it."""

import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Self

from dropanchor_service.cluster import leases
from dropanchor_service.cluster.boot_clock import boot_s
from dropanchor_service.cluster.database import Connection, DatabaseError, sentence_of
from dropanchor_service.cluster.tenure import Standing, Tenure
from dropanchor_service.runtime.worker import Worker

RENEWALS = 4  # per lease
TICKS = 16

_log = logging.getLogger(__name__)


class Renewal(Worker):
    """Renews the lease four times per lease, and ends with it. database_error: why the last renewal failed, or None."""

    def __init__(self, connect: Callable[[], Connection], bucket: str, lease_s: float, tenure: Tenure) -> None:
        super().__init__("lease", stop_s=3.0)
        self._connect = connect
        self._bucket = bucket
        self._lease_s = lease_s
        self._tenure = tenure
        self._ticks = threading.Thread(target=self._tick, name="lease ticks", daemon=True)
        self._connection: Connection | None = None
        self.database_error: str | None = None

    def __enter__(self) -> Self:
        self._ticks.start()
        return super().__enter__()

    def __exit__(self, *raised: object) -> None:
        super().__exit__(*raised)
        self._ticks.join(1.0)
        self._release()

    def _tick(self) -> None:
        while not self._stop.wait(self._lease_s / TICKS):
            self._tenure.tick()

    def _run(self) -> None:
        while not self._stop.is_set() and not self._tenure.why_lost:
            try:
                self._renew()
            except DatabaseError as error:
                if self.database_error is None:
                    _log.warning("the lease of %s cannot be renewed: %s", self._bucket, sentence_of(error))
                self.database_error = sentence_of(error)
                self._disconnect()
            else:
                if self.database_error is not None:
                    _log.info("the database answers again")
                self.database_error = None
            self._stop.wait(self._lease_s / RENEWALS)

    def _renew(self) -> None:
        if self._tenure.standing is Standing.LEAVING:
            return  # until a successor shows its token; the bucket may have moved on to another one meanwhile
        asked_s = boot_s()
        if self._connection is None:
            self._connection = self._connect()
        if leases.renew(self._connection, self._bucket, self._tenure.epoch):
            self._tenure.renewed(asked_s)
            return
        found = leases.read(self._connection, self._bucket)
        if found is None:
            self._tenure.lose(f"its lease of {self._bucket} is gone from the table")
        elif found.epoch <= self._tenure.epoch:
            self._tenure.lose(f"its lease of {self._bucket} was changed by hand to another epoch")
        elif found.was_moved and found.epoch == self._tenure.epoch + 1:
            self._tenure.hand_over()
        else:
            self._tenure.lose(f"{found.owner or 'nobody'} owns {self._bucket} now, epoch {found.epoch}")

    def _release(self) -> None:
        """Give the bucket back, if it is still this process's, unless the thread waits for the database."""
        if self.is_alive:
            return
        if self._connection is not None and not self._tenure.why_lost:
            with suppress(DatabaseError):
                leases.release(self._connection, self._bucket, self._tenure.epoch)
        self._disconnect()

    def _disconnect(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

"""Wait until this process may serve its bucket."""

import logging
import time
from collections.abc import Callable

from dropanchor_schemas.sentences import say
from dropanchor_service.cluster import leases
from dropanchor_service.cluster.boot_clock import boot_s
from dropanchor_service.cluster.database import Connection, DatabaseError, make_tables, sentence_of
from dropanchor_service.cluster.leases import Claimant, Claimed
from dropanchor_service.cluster.sentences import database_away, standby_of, unable
from dropanchor_service.cluster.watch import Watch, obstacle

LOOK_S = 0.1
NOTE_S = 1.0  # between two notes in the database that this standby is there
RETRY_S = 0.5

_log = logging.getLogger(__name__)


class Standby:
    """Looks at the lease of a bucket until it can claim it. sentence: what it waits for, for people.

    connect: raises DatabaseError. layout: of the checkpoints that this version writes.
    """

    def __init__(self, connect: Callable[[], Connection], bucket: str, who: Claimant, layout: str) -> None:
        self._connect = connect
        self._bucket = bucket
        self._who = who
        self._layout = layout
        self._watch = Watch(who.lease_s, who.name)
        self._noted_s = 0.0
        self.sentence: str = say("starting", "The service is starting.")

    def wait(self, on_look: Callable[[], None]) -> Claimed:
        """Return what was claimed. on_look: called about once a second."""
        while True:
            on_look()
            try:
                with self._connect() as connection:
                    make_tables(connection)
                    return self._watched(connection, on_look)
            except DatabaseError as error:
                self._watch.look_away()
                self._say(database_away(self._bucket, sentence_of(error)))
                time.sleep(RETRY_S)

    def _watched(self, connection: Connection, on_look: Callable[[], None]) -> Claimed:
        while True:
            lease, now_s = leases.seen_or_new(connection, self._bucket), boot_s()
            why_not = obstacle(lease, self._who.sites, self._layout)
            if self._watch.may_claim(lease, now_s) and why_not is None:
                claim = leases.claim(connection, lease, self._who)
                if claim is not None:
                    before = lease.owner or "nobody"
                    _log.info("this process owns %s now, epoch %d (before: %s)", self._bucket, claim.epoch, before)
                    return Claimed(claim, now_s)
            self._say(standby_of(lease) if why_not is None else unable(lease, why_not))
            if now_s - self._noted_s > NOTE_S:
                self._noted_s = now_s
                on_look()
                leases.note_standby(connection, self._bucket, self._who.name, why_not)
            time.sleep(LOOK_S)

    def _say(self, sentence: str) -> None:
        if sentence != self.sentence:
            self.sentence = sentence
            _log.info("%s", sentence)

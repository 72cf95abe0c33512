"""The persistent queues of destinations. An event leaves its queue when the receiver has accepted it.

`again_ns` of a dead letter: when it goes back into its queue. Of a queued event: when it went back, NULL: it has never
been a dead letter.
"""

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import orjson

from dropanchor_service.events.database import Database

MAX_LISTED = 1000
_SINCE = "max(t_ns, coalesce(again_ns, 0))"


class Delivery(NamedTuple):
    """An event that waits for a destination.

    since_ns: when it happened, or went back from the dead letters. refusals: how often the receiver has refused it.
    """

    sequence: int
    tag: str
    since_ns: int
    refusals: int
    body: bytes


class QueueState(NamedTuple):
    """How many events wait and are dead. oldest_ns: since when the oldest waits, None: none waits."""

    pending: int = 0
    dead: int = 0
    oldest_ns: int | None = None


class Deliveries:
    """The queues of all destinations. Any thread may use it. Every method raises sqlite3.Error."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._retried: Callable[[], None] = lambda: None

    @property
    def may_wait(self) -> bool:
        """Whether there may be events in a queue."""
        return self._database.is_made

    def on_retry(self, retried: Callable[[], None]) -> None:
        """Call this after dead letters were put back, on the thread that does it."""
        self._retried = retried

    def oldest(self, destination: str, limit: int, waiting: Collection[str] = ()) -> list[Delivery]:
        """Return the oldest events of the queue, at most `limit`. waiting: tags that are left out."""
        rows = self._database.rows(
            f"SELECT sequence, tag, {_SINCE}, refusals, body FROM deliveries JOIN events USING (sequence) "
            "WHERE destination = ? AND dead IS NULL AND tag NOT IN (SELECT value FROM json_each(?)) "
            "ORDER BY sequence LIMIT ?",
            destination,
            orjson.dumps(list(waiting)).decode(),
            limit,
        )
        return list(map(Delivery._make, rows))

    def heads(self, destination: str, limit: int, window: int, waiting: Collection[str] = ()) -> list[Delivery]:
        """Return the oldest event of each tag, at most `limit`, from the first `window` events of the queue.

        waiting: tags that are left out.
        """
        found: dict[str, Delivery] = {}
        for delivery in self.oldest(destination, window, waiting):
            if len(found) < limit:
                found.setdefault(delivery.tag, delivery)
        return list(found.values())

    def remove(self, destination: str, sequences: Sequence[int]) -> None:
        """Take delivered events from the queue."""
        self._each("DELETE FROM deliveries", destination, sequences)

    def refuse(self, destination: str, sequences: Sequence[int]) -> None:
        """Count a refusal of each event by the receiver."""
        self._each("UPDATE deliveries SET refusals = refusals + 1", destination, sequences)

    def bury(self, destination: str, sequences: Sequence[int], reason: str, again_ns: int | None = None) -> None:
        """Make dead letters of these events.

        again_ns: when those go back into the queue that were no dead letters before; None: never.
        """
        change = "UPDATE deliveries SET dead = ?, again_ns = CASE WHEN again_ns IS NULL THEN ? END"
        self._each(change, destination, sequences, reason, again_ns)

    def next_chance(self, destination: str) -> int | None:
        """Return when the next dead letter goes back into the queue, None: none does."""
        rows = self._database.rows(
            "SELECT min(again_ns) FROM deliveries WHERE destination = ? AND dead IS NOT NULL", destination
        )
        found: int | None = rows[0][0]
        return found

    def give_second_chance(self, destination: str, now_ns: int) -> None:
        """Put the dead letters back into the queue whose time has come."""
        with self._database.transaction() as connection:
            connection.execute(
                "UPDATE deliveries SET dead = NULL, refusals = 0 "
                "WHERE destination = ? AND dead IS NOT NULL AND again_ns <= ?",
                (destination, now_ns),
            )

    def expired(self, destination: str, before_ns: int) -> list[int]:
        """Return queued events that have waited since before this time."""
        rows = self._database.rows(
            "SELECT sequence FROM deliveries JOIN events USING (sequence) "
            f"WHERE destination = ? AND dead IS NULL AND {_SINCE} < ? ORDER BY sequence LIMIT ?",
            destination,
            before_ns,
            MAX_LISTED,
        )
        return [row[0] for row in rows]

    def dead(self, destination: str) -> list[tuple[bytes, str]]:
        """Return the oldest dead letters: body and reason."""
        return self._database.rows(
            "SELECT body, dead FROM deliveries JOIN events USING (sequence) "
            "WHERE destination = ? AND dead IS NOT NULL ORDER BY sequence LIMIT ?",
            destination,
            MAX_LISTED,
        )

    def retry(self, destination: str, now_ns: int) -> int:
        """Put the dead letters of a destination back into its queue. Return how many."""
        sql = "UPDATE deliveries SET dead = NULL, refusals = 0, again_ns = ? WHERE destination = ? AND dead IS NOT NULL"
        with self._database.transaction() as connection:
            count = connection.execute(sql, (now_ns, destination)).rowcount
        self._retried()
        return count

    def drop_dead(self, destination: str) -> None:
        """Delete the dead letters of a destination."""
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM deliveries WHERE destination = ? AND dead IS NOT NULL", (destination,))

    def drop(self, destination: str) -> None:
        """Empty the queue of a destination that no longer exists."""
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM deliveries WHERE destination = ?", (destination,))

    def states(self) -> dict[str, QueueState]:
        """Return the state of every queue that is not empty, by destination."""
        if not self._database.is_made:
            return {}
        rows = self._database.rows(
            "SELECT destination, pending, dead, (SELECT "
            f"{_SINCE} FROM events JOIN deliveries USING (sequence) "
            "WHERE sequence = first AND destination = queues.destination) FROM ("
            "SELECT destination, count(*) - count(dead) AS pending, count(dead) AS dead, "
            "min(CASE WHEN dead IS NULL THEN sequence END) AS first FROM deliveries GROUP BY destination) AS queues"
        )
        return {destination: QueueState(*state) for destination, *state in rows}

    def _each(self, change: str, destination: str, sequences: Sequence[int], *values: str | int | None) -> None:
        """Change the delivery of each event, in one transaction. values: of the placeholders in `change`."""
        with self._database.transaction() as connection:
            connection.executemany(
                f"{change} WHERE destination = ? AND sequence = ?",
                [(*values, destination, sequence) for sequence in sequences],
            )

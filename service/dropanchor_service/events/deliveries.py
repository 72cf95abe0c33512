"""The persistent queues of webhooks. An event leaves its queue when the receiver has accepted it."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

from dropanchor_service.events.database import Database

MAX_LISTED = 1000


class Delivery(NamedTuple):
    """An event that waits for a webhook. refusals: how often the receiver has refused it."""

    sequence: int
    tag: str
    t_ns: int
    refusals: int
    body: bytes


class Deliveries:
    """The queues of all webhooks. Any thread may use it. Every method raises sqlite3.Error."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def heads(self, webhook: str, limit: int, window: int, waiting: Collection[str] = ()) -> list[Delivery]:
        """Return the oldest event of each tag, at most `limit`, from the first `window` events of the queue.

        waiting: tags that are left out.
        """
        rows = self._database.rows(
            "SELECT sequence, tag, t_ns, refusals, body FROM deliveries JOIN events USING (sequence) "
            "WHERE webhook = ? AND dead IS NULL ORDER BY sequence LIMIT ?",
            webhook,
            window,
        )
        found: dict[str, Delivery] = {}
        for row in rows:
            delivery = Delivery(*row)
            if delivery.tag not in waiting and len(found) < limit:
                found.setdefault(delivery.tag, delivery)
        return list(found.values())

    def remove(self, webhook: str, sequences: Sequence[int]) -> None:
        """Take delivered events from the queue."""
        with self._database.transaction() as connection:
            connection.executemany(
                "DELETE FROM deliveries WHERE webhook = ? AND sequence = ?", [(webhook, n) for n in sequences]
            )

    def refuse(self, webhook: str, sequence: int) -> None:
        """Count a refusal by the receiver."""
        with self._database.transaction() as connection:
            connection.execute(
                "UPDATE deliveries SET refusals = refusals + 1 WHERE webhook = ? AND sequence = ?", (webhook, sequence)
            )

    def bury(self, webhook: str, sequences: Sequence[int], reason: str) -> None:
        """Make dead letters of these events."""
        with self._database.transaction() as connection:
            connection.executemany(
                "UPDATE deliveries SET dead = ? WHERE webhook = ? AND sequence = ?",
                [(reason, webhook, n) for n in sequences],
            )

    def expired(self, webhook: str, before_ns: int) -> list[int]:
        """Return queued events that are older than this time."""
        rows = self._database.rows(
            "SELECT sequence FROM deliveries JOIN events USING (sequence) "
            "WHERE webhook = ? AND dead IS NULL AND t_ns < ? ORDER BY sequence LIMIT ?",
            webhook,
            before_ns,
            MAX_LISTED,
        )
        return [row[0] for row in rows]

    def dead(self, webhook: str) -> list[tuple[bytes, str]]:
        """Return the oldest dead letters: body and reason."""
        return self._database.rows(
            "SELECT body, dead FROM deliveries JOIN events USING (sequence) "
            "WHERE webhook = ? AND dead IS NOT NULL ORDER BY sequence LIMIT ?",
            webhook,
            MAX_LISTED,
        )

    def retry(self, webhook: str) -> int:
        """Put the dead letters of a webhook back into its queue. Return how many."""
        with self._database.transaction() as connection:
            return connection.execute(
                "UPDATE deliveries SET dead = NULL, refusals = 0 WHERE webhook = ? AND dead IS NOT NULL", (webhook,)
            ).rowcount

    def drop(self, webhook: str) -> None:
        """Empty the queue of a webhook that no longer exists."""
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM deliveries WHERE webhook = ?", (webhook,))

    def counts(self) -> dict[str, tuple[int, int]]:
        """Return, by webhook, how many events wait and how many are dead."""
        rows = self._database.rows("SELECT webhook, count(*) - count(dead), count(dead) FROM deliveries GROUP BY 1")
        return {webhook: (pending, dead) for webhook, pending, dead in rows}

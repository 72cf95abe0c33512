"""Find tags that have stopped sending while they are online."""

import numpy as np

from dropanchor_service.store import Rows
from dropanchor_service.store.records import enlarged

SILENT_NS = 1_000_000_000


class SilentTags:
    """Returns each tag once per silence, and once more after `return_again`.

    A tag is silent when two looks in a row find the same last message: the first one may come when this process stood
    still, and what the tag sent meanwhile waits to be received. What was heard before this object was created does not
    count.
    """

    def __init__(self, rows: Rows) -> None:
        self._rows = rows
        # By row: the start of the last silence that was returned.
        self._known_ns = rows.copy_counts()["last_heard_ns"].copy()
        self._seen_ns = np.zeros_like(self._known_ns)  # the same, of the silence that the last look found

    def take(self, now_ns: int, limit: int) -> list[int]:
        """Return the rows of up to `limit` tags that have fallen silent, the longest silent first.

        now_ns: UTC.
        """
        heard_ns = self._rows.copy_counts()["last_heard_ns"]
        if len(heard_ns) > len(self._known_ns):
            self._known_ns, self._seen_ns = (
                enlarged(times, 2 * len(heard_ns)) for times in (self._known_ns, self._seen_ns)
            )
        known_ns, seen_ns = (times[: len(heard_ns)] for times in (self._known_ns, self._seen_ns))
        new = (heard_ns != known_ns) & (now_ns - heard_ns > SILENT_NS)
        rows = np.flatnonzero(new & (heard_ns == seen_ns))
        seen_ns[:] = np.where(new, heard_ns, 0)
        rows = rows[self._rows.are_online(rows)]
        rows = rows[np.argsort(heard_ns[rows], kind="stable")][:limit]
        self._known_ns[rows] = heard_ns[rows]
        found: list[int] = rows.tolist()
        return found

    def return_again(self, row: int) -> None:
        """Return this tag once more if it is still silent."""
        self._known_ns[row] = 0

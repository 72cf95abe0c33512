"""Find tags that have stopped sending while they are online."""

import numpy as np

from dropanchor_service.store import Rows
from dropanchor_service.store.records import enlarged

SILENT_NS = 1_000_000_000


class SilentTags:
    """Returns each tag once per silence, and once more after `return_again`.

    What was heard before this object was created does not count.
    """

    def __init__(self, rows: Rows) -> None:
        self._rows = rows
        # By row: the start of the last silence that was returned.
        self._known_ns = rows.copy_counts()["last_heard_ns"].copy()

    def take(self, now_ns: int, limit: int) -> list[int]:
        """Return the rows of up to `limit` tags that have fallen silent, the longest silent first.

        now_ns: UTC.
        """
        heard_ns = self._rows.copy_counts()["last_heard_ns"]
        if len(heard_ns) > len(self._known_ns):
            self._known_ns = enlarged(self._known_ns, 2 * len(heard_ns))
        new = (heard_ns != self._known_ns[: len(heard_ns)]) & (now_ns - heard_ns > SILENT_NS)
        rows = np.flatnonzero(new)
        rows = rows[self._rows.are_online(rows)]
        rows = rows[np.argsort(heard_ns[rows], kind="stable")][:limit]
        self._known_ns[rows] = heard_ns[rows]
        found: list[int] = rows.tolist()
        return found

    def return_again(self, row: int) -> None:
        """Return this tag once more if it is still silent."""
        self._known_ns[row] = 0

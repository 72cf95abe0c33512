"""Anchors that no longer seem to be where the site says they are."""

from collections.abc import Mapping
from typing import NamedTuple


class AnchorDoubt(NamedTuple):
    """anchor: its id. way_m: how far off it stands, about. since_ns: when it moved, UTC; 0: it never stood there."""

    anchor: str
    way_m: float
    since_ns: int


class AnchorDoubts:
    """Doubts by row of a tag that hears such an anchor. The ingest thread writes; any thread reads.

    changes: how often they have changed.
    """

    def __init__(self) -> None:
        self._of_rows: dict[int, AnchorDoubt] = {}
        self.changes = 0

    @property
    def of_rows(self) -> Mapping[int, AnchorDoubt]:
        return self._of_rows

    def of(self, row: int) -> AnchorDoubt | None:
        """Return the anchor of a tag that is in doubt, None if there is none."""
        return self._of_rows.get(row)

    def set(self, row: int, doubt: AnchorDoubt) -> None:
        """Replace what is known about a row."""
        self._of_rows[row] = doubt
        self.changes += 1

    def end(self, doubt: AnchorDoubt) -> None:
        """Forget a doubt, whichever tags it is of."""
        for row, known in list(self._of_rows.items()):
            if known is doubt:
                self._of_rows.pop(row, None)
                self.changes += 1

"""The tags that have sent messages or are configured: the row of each tag and its counters."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from threading import Lock

import numpy as np

from dropanchor_schemas import kinds
from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.arrivals import Arrivals
from dropanchor_service.store.presence import Presence
from dropanchor_service.store.records import enlarged
from dropanchor_service.store.unknown_anchors import UnknownAnchors

KINDS = tuple(kind.name for kind in kinds.KINDS)
REASONS = tuple(Reason)

_COUNTS = np.dtype(
    [
        ("first_heard_ns", "i8"),  # 0: never
        ("last_heard_ns", "i8"),
        ("messages", "i8"),
        ("samples", "i8", len(KINDS)),
        ("rejected", "u4", len(REASONS)),
    ]
)


@dataclass(frozen=True, slots=True)
class Tag:
    """One tag. Its counters are columns of the table."""

    name: str
    row: int
    table: "TagTable"

    @property
    def online(self) -> bool:
        return self.table.presence.is_online(self.name)

    @property
    def first_heard_ns(self) -> int | None:
        return int(self.table.counts(self.row)["first_heard_ns"]) or None

    @property
    def last_heard_ns(self) -> int | None:
        return int(self.table.counts(self.row)["last_heard_ns"]) or None

    @property
    def messages(self) -> int:
        return int(self.table.counts(self.row)["messages"])

    @property
    def samples(self) -> Counter[str]:
        """The number of samples that reached the engine, by kind."""
        return _named(KINDS, self.table.counts(self.row)["samples"])

    @property
    def rejected(self) -> Counter[str]:
        """The number of messages and samples that were rejected, by reason."""
        return _named(REASONS, self.table.counts(self.row)["rejected"])


class TagTable:
    """Maps names to rows. Rows are dense, follow the order of registration and are never reused.

    Only the ingest thread writes the counters; any thread may read them.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._by_name: dict[str, Tag] = {}
        self._by_row: list[Tag] = []
        self._counts = np.zeros(16, _COUNTS)
        self.presence = Presence()
        self._replay_lag_ns = np.zeros(16, np.int64)  # how far a replayed tag lies in the past, by row
        self._deleted: frozenset[int] = frozenset()
        self.unknown_anchors = UnknownAnchors()
        self.arrivals = Arrivals()

    def __len__(self) -> int:
        return len(self._by_row)

    def find(self, name: str) -> Tag | None:
        """Return the tag of this name, or None."""
        return self._by_name.get(name)

    def at(self, row: int) -> Tag:
        """Return the tag of this row. Raises IndexError when no tag has it."""
        return self._by_row[row]

    def all(self) -> list[Tag]:
        """Return every tag that has a row, in the order of the rows."""
        return self._by_row[:]

    def listed(self) -> list[Tag]:
        """Return every tag that is not deleted."""
        deleted = self._deleted
        return [tag for tag in self._by_row if tag.row not in deleted]

    @property
    def deleted(self) -> frozenset[int]:
        """The rows of the tags that were deleted and not registered again."""
        return self._deleted

    def is_deleted(self, row: int) -> bool:
        """Return whether the tag of this row was deleted and not registered again."""
        return row in self._deleted

    def delete(self, row: int) -> None:
        """Clear the counters of a row, and take its tag off the list until it is registered again."""
        with self._lock:
            self._counts[row] = 0
            self._deleted |= {row}

    def names(self, rows: Sequence[int]) -> list[str]:
        by_row = self._by_row
        return [by_row[row].name for row in rows]

    def register(self, name: str) -> Tag:
        """Return the tag of this name; add it when it is new, and list it again when it was deleted."""
        with self._lock:
            tag = self._by_name.get(name)
            if tag is None:
                tag = Tag(name, len(self._by_row), self)
                self._grow(tag.row + 1)
                self.presence.add_row(name, tag.row)
                self._by_row.append(tag)
                self._by_name[name] = tag
            self._deleted -= {tag.row}
            return tag

    def set_replay_lag(self, rows: Array, lag_ns: Array) -> None:
        """Set how far the samples of replayed tags lie in the past, ns; 0 for live tags."""
        self._replay_lag_ns[rows] = lag_ns

    def age_s(self, poses: Array, now_ns: int) -> Array:
        """Return the age of each POSE, s. The age of a replayed tag counts from the current time of its recording."""
        age_s: Array = (now_ns - self._replay_lag_ns[poses["row"]] - poses["t_ns"]) * 1e-9
        return age_s

    def copy_counts(self) -> Array:
        """Return a copy of all counters, one record per row."""
        return self._counts[: len(self._by_row)].copy()

    def restore(self, names: Sequence[str], counts: Array) -> None:
        """Load the names and counters of an earlier table. This table must be empty."""
        for name in names:
            self.register(name)
        self._counts[: len(names)] = counts

    def counts(self, row: int | Array) -> Array:
        """Return the counters of one row, or of several."""
        return self._counts[row]

    def count_messages(self, rows: Array, now_ns: int) -> None:
        """Count one message for each entry of `rows`, and note the time. A row may appear several times."""
        first = self._counts["first_heard_ns"]
        first[rows[first[rows] == 0]] = now_ns
        self._counts["last_heard_ns"][rows] = now_ns
        _count(self._counts["messages"], rows)

    def count_samples(self, kind: str, rows: Array) -> None:
        """Count one sample for each entry of `rows`. The entries of one message stand side by side."""
        _count(self._counts["samples"][:, KINDS.index(kind)], rows)

    def count_rejected(self, reason: Reason, rows: Array) -> None:
        """Count one rejection for each entry of `rows`."""
        _count(self._counts["rejected"][:, REASONS.index(reason)], rows)

    def _grow(self, rows: int) -> None:
        self.arrivals.grow(rows)
        if rows > len(self._counts):
            self._counts = enlarged(self._counts, 2 * len(self._counts))
            self._replay_lag_ns = enlarged(self._replay_lag_ns, len(self._counts))


def _count(column: Array, rows: Array) -> None:
    """Add one for every entry of `rows`. This is fast when equal entries stand side by side."""
    if not len(rows):
        return
    ends = np.append(np.flatnonzero(rows[1:] != rows[:-1]), len(rows) - 1)
    np.add.at(column, rows[ends].astype(np.intp), np.diff(ends, prepend=-1).astype(column.dtype))


def _named(names: tuple[str, ...], counts: Array) -> Counter[str]:
    return Counter({str(name): int(count) for name, count in zip(names, counts, strict=True) if count})

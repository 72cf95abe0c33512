"""The tags that have been heard or configured: the row of each, and what was received from it."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from threading import Lock

import numpy as np

from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.records import enlarged
from dropanchor_service.store.unknown_anchors import UnknownAnchors

KINDS = ("imu", "range", "heading", "bearing")
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
    """One tag. Its counters live in the columns of the table."""

    name: str
    row: int
    table: "TagTable"

    @property
    def online(self) -> bool:
        return self.table.is_online(self.name)

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
        """Samples that reached the engine, by kind."""
        return _named(KINDS, self.table.counts(self.row)["samples"])

    @property
    def rejected(self) -> Counter[str]:
        """Messages and samples that were not used, by reason."""
        return _named(REASONS, self.table.counts(self.row)["rejected"])


class TagTable:
    """Names and rows. Rows are dense, given in order of registration, and never reused.

    Counters are written by the ingest thread only; any thread may read them.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._by_name: dict[str, Tag] = {}
        self._by_row: list[Tag] = []
        self._counts = np.zeros(16, _COUNTS)
        self._online: set[str] = set()
        self._is_online = np.zeros(16, bool)  # the same, by row
        self._behind_ns = np.zeros(16, np.int64)  # how far the recording of a replayed tag lies in the past, by row
        self.unknown_anchors = UnknownAnchors()

    def __len__(self) -> int:
        return len(self._by_row)

    def find(self, name: str) -> Tag | None:
        return self._by_name.get(name)

    def at(self, row: int) -> Tag:
        """Raises IndexError for a row that was never given."""
        return self._by_row[row]

    def all(self) -> list[Tag]:
        return self._by_row[:]

    def names(self, rows: Sequence[int]) -> list[str]:
        by_row = self._by_row
        return [by_row[row].name for row in rows]

    def register(self, name: str) -> Tag:
        """The tag of this name, made when it is new."""
        with self._lock:
            tag = self._by_name.get(name)
            if tag is None:
                tag = Tag(name, len(self._by_row), self)
                self._grow(tag.row + 1)
                self._is_online[tag.row] = name in self._online
                self._by_row.append(tag)
                self._by_name[name] = tag
            return tag

    def set_online(self, name: str, online: bool) -> None:
        """A token may be seen before the tag is registered; it is remembered."""
        with self._lock:
            (self._online.add if online else self._online.discard)(name)
            tag = self._by_name.get(name)
            if tag is not None:
                self._is_online[tag.row] = online

    def is_online(self, name: str) -> bool:
        return name in self._online

    def are_online(self, rows: Array) -> Array:
        online: Array = self._is_online[rows]
        return online

    def set_behind(self, rows: Array, behind_ns: Array) -> None:
        """How far what these tags replay lies in the past, ns; 0 for tags that are live."""
        self._behind_ns[rows] = behind_ns

    def age_s(self, poses: Array, now_ns: int) -> Array:
        """Age of POSE of any rows, s. The present of a replayed tag is where its recording has come to."""
        age_s: Array = (now_ns - self._behind_ns[poses["row"]] - poses["t_ns"]) * 1e-9
        return age_s

    @property
    def online_names(self) -> int:
        """How many names have a liveliness token, registered or not."""
        return len(self._online)

    def copy_counts(self) -> Array:
        """All counters, one record per row."""
        return self._counts[: len(self._by_row)].copy()

    def restore(self, names: Sequence[str], counts: Array) -> None:
        """Take over the rows and counters of another table, in an empty one."""
        for name in names:
            self.register(name)
        self._counts[: len(names)] = counts

    def counts(self, row: int | Array) -> Array:
        """Of one row, or of each of several."""
        return self._counts[row]

    def count_messages(self, rows: Array, now_ns: int) -> None:
        """One message from each of `rows` (repeated for several)."""
        first = self._counts["first_heard_ns"]
        first[rows[first[rows] == 0]] = now_ns
        self._counts["last_heard_ns"][rows] = now_ns
        _count(self._counts["messages"], rows)

    def count_samples(self, kind: str, rows: Array) -> None:
        """rows: one entry per sample, those of a message side by side."""
        _count(self._counts["samples"][:, KINDS.index(kind)], rows)

    def count_rejected(self, reason: Reason, rows: Array) -> None:
        _count(self._counts["rejected"][:, REASONS.index(reason)], rows)

    def _grow(self, rows: int) -> None:
        if rows > len(self._counts):
            self._counts = enlarged(self._counts, 2 * len(self._counts))
            self._is_online = enlarged(self._is_online, len(self._counts))
            self._behind_ns = enlarged(self._behind_ns, len(self._counts))


def _count(column: Array, rows: Array) -> None:
    """Add one for every entry of `rows`; quick where equal entries stand side by side."""
    if not len(rows):
        return
    ends = np.append(np.flatnonzero(rows[1:] != rows[:-1]), len(rows) - 1)
    np.add.at(column, rows[ends].astype(np.intp), np.diff(ends, prepend=-1).astype(column.dtype))


def _named(names: tuple[str, ...], counts: Array) -> Counter[str]:
    return Counter({str(name): int(count) for name, count in zip(names, counts, strict=True) if count})

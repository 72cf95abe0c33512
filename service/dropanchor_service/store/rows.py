"""The columns of all tags of all sites: a row for each tag, with its counters and what is known about its samples."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock

import numpy as np

from dropanchor_schemas import kinds
from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.anchor_doubts import AnchorDoubts
from dropanchor_service.store.arrivals import Arrivals
from dropanchor_service.store.findings import SensorFindings
from dropanchor_service.store.norths import Norths
from dropanchor_service.store.presence import OnlineUntil, Presence
from dropanchor_service.store.recent import Recent
from dropanchor_service.store.records import enlarged, take
from dropanchor_service.store.starts import StartNewsQueue
from dropanchor_service.store.wrong_times import WrongTimes

FEW = 128  # entries up to which a dictionary counts faster than NumPy
KINDS = tuple(kind.name for kind in kinds.KINDS)
MESSAGE = "message"
SCREENED = (*KINDS, MESSAGE)
REASONS = tuple(Reason)

COUNTS = np.dtype(
    [
        ("first_heard_ns", "i8"),  # 0: never
        ("last_heard_ns", "i8"),
        ("messages", "i8"),
        ("samples", "i8", len(KINDS)),
        ("rejected", "u4", len(REASONS)),
        ("screened", "u4", len(SCREENED)),  # samples that did not reach the engine, and unreadable messages
        ("unused", "u4", len(KINDS)),  # samples that the engine did not use
    ]
)


@dataclass(frozen=True, slots=True)
class Tag:
    """One tag. Its counters are columns of `rows`. site: index of its site. presence: of the tags of its site."""

    name: str
    row: int
    site: int
    rows: "Rows"
    presence: Presence

    @property
    def online(self) -> bool:
        return self.presence.is_online(self.name)

    @property
    def first_heard_ns(self) -> int | None:
        return int(self.rows.counts(self.row)["first_heard_ns"]) or None

    @property
    def last_heard_ns(self) -> int | None:
        return int(self.rows.counts(self.row)["last_heard_ns"]) or None

    @property
    def messages(self) -> int:
        return int(self.rows.counts(self.row)["messages"])

    @property
    def samples(self) -> Counter[str]:
        """The number of samples that reached the engine, by kind."""
        return _named(KINDS, self.rows.counts(self.row)["samples"])

    @property
    def arrived(self) -> Counter[str]:
        """The number of samples that arrived in readable messages, by kind."""
        counts = self.rows.counts(self.row)
        return _named(KINDS, counts["samples"] + counts["screened"][: len(KINDS)])

    @property
    def used(self) -> Counter[str]:
        """The number of samples that the engine used, by kind."""
        counts = self.rows.counts(self.row)
        return _named(KINDS, counts["samples"] - counts["unused"])

    @property
    def rejected(self) -> Counter[str]:
        """The number of messages and samples that were rejected, by reason."""
        return _named(REASONS, self.rows.counts(self.row)["rejected"])


class Rows:
    """Rows are dense, follow the order of registration and are never reused.

    Only the ingest thread writes the counters; any thread may read them.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._tags: list[Tag] = []
        self._sites = np.zeros(16, np.int32)
        self._counts = np.zeros(16, COUNTS)
        self._replay_lag_ns = np.zeros(16, np.int64)  # how far a replayed tag lies in the past
        self._lag_ns = np.zeros(16, np.int64)  # how long measurements wait for IMU samples in batches
        self._deleted: frozenset[int] = frozenset()
        self.arrivals = Arrivals()
        self.findings = SensorFindings()
        self.anchor_doubts = AnchorDoubts()
        self.norths = Norths()
        self.start_news = StartNewsQueue()
        self.wrong_times = WrongTimes()
        self.clock_errors: Mapping[int, float] = {}  # by row: how far a clock that is off is ahead of UTC, s
        self.low_pressures: dict[int, float] = {}  # by row: the last one below what a barometer shows in Pa, as sent
        self.recent = Recent(COUNTS)
        self.online_until = OnlineUntil()

    def __len__(self) -> int:
        return len(self._tags)

    def add(self, site: int, name: str, presence: Presence) -> Tag:
        """Return a new tag in the next row."""
        with self._lock:
            tag = Tag(name, len(self._tags), site, self, presence)
            self._grow(tag.row + 1)
            self._sites[tag.row] = site
            presence.add_row(name, tag.row)
            self._tags.append(tag)
            return tag

    def at(self, row: int) -> Tag:
        """Return the tag of this row. Raises IndexError when no tag has it."""
        return self._tags[row]

    def all(self) -> list[Tag]:
        """Return every tag, in the order of the rows."""
        return self._tags[:]

    def names(self, rows: Sequence[int]) -> list[str]:
        tags = self._tags
        return [tags[row].name for row in rows]

    def sites(self, rows: Array) -> Array:
        """Return the index of the site of each row."""
        sites: Array = self._sites[rows]
        return sites

    def by_site(self, poses: Array) -> Iterator[tuple[int, Array]]:
        """Yield POSE, or other records with a row, by site: its index, and its records in their order."""
        of_site = self._sites[poses["row"]]
        order = np.argsort(of_site, kind="stable")
        sites, begins = np.unique(of_site[order], return_index=True)
        for site, rows in zip(sites.tolist(), np.split(order, begins[1:]), strict=False):
            yield site, take(poses, rows)

    def are_online(self, rows: Array) -> Array:
        """Return whether the tag of each row is online."""
        return self.online_until.are_online(rows)

    @property
    def deleted(self) -> frozenset[int]:
        """The rows of the tags that were deleted and not registered again."""
        return self._deleted

    def delete(self, row: int) -> None:
        """Clear the counters of a row, and note that its tag is deleted."""
        with self._lock:
            self._counts[row] = 0
            self.recent.drop(row)
            self._deleted |= {row}

    def hide(self, row: int) -> None:
        """Note that the tag of a row is deleted, but keep its counters."""
        with self._lock:
            self._deleted |= {row}

    def undelete(self, row: int) -> None:
        """Note that the tag of a row is registered again."""
        with self._lock:
            self._deleted -= {row}

    def set_replay_lag(self, rows: Array, lag_ns: Array) -> None:
        """Set how far the samples of replayed tags lie in the past, ns; 0 for live tags."""
        self._replay_lag_ns[rows] = lag_ns

    def age_s(self, poses: Array, now_ns: int) -> Array:
        """Return the age of each POSE, s. The age of a replayed tag counts from the current time of its recording."""
        age_s: Array = (now_ns - self._replay_lag_ns[poses["row"]] - poses["t_ns"]) * 1e-9
        return age_s

    def set_lag(self, lags: Array) -> None:
        """Set how long the measurements of rows wait for IMU samples. lags: LAG."""
        self._lag_ns[lags["row"]] = lags["lag_ns"]

    def lag_s(self, rows: int | Array) -> Array:
        """Return how late the poses of these rows come, at most, because they wait for IMU samples in batches; s."""
        lag_s: Array = self._lag_ns[rows] * 1e-9
        return lag_s

    def overdue_s(self, poses: Array, now_ns: int) -> Array:
        """Return the age of each POSE without the time that it waited for IMU samples in batches, s."""
        overdue_s: Array = self.age_s(poses, now_ns) - self.lag_s(poses["row"])
        return overdue_s

    def counts(self, row: int | Array) -> Array:
        """Return the counters of one row, or of several."""
        return self._counts[row]

    def copy_counts(self) -> Array:
        """Return a copy of all counters, one record per row."""
        return self._counts[: len(self._tags)].copy()

    def restore_counts(self, counts: Array) -> None:
        """Load the counters of the rows that earlier rows had."""
        self._counts[: len(counts)] = counts
        self.recent.forget()

    def count_messages(self, rows: Array, now_ns: int) -> None:
        """Count one message for each entry of `rows`, and note the time. A row may appear several times."""
        self.recent.follow(rows, self._counts, now_ns)
        first = self._counts["first_heard_ns"]
        first[rows[first[rows] == 0]] = now_ns
        self._counts["last_heard_ns"][rows] = now_ns
        _count(self._counts["messages"], rows)

    def count_samples(self, kind: str, rows: Array) -> None:
        """Count one sample for each entry of `rows`. The entries of one message stand side by side."""
        _count(self._counts["samples"][:, KINDS.index(kind)], rows)

    def count_screened(self, what: str, rows: Array) -> None:
        """Count one sample of this kind that did not reach the engine, or a message, for each entry of `rows`."""
        self.recent.begin(rows, self._counts)
        _count(self._counts["screened"][:, SCREENED.index(what)], rows)

    def count_unused(self, kind: str, rows: Array) -> None:
        """Count one sample that the engine did not use for each entry of `rows`."""
        self.recent.begin(rows, self._counts)
        _count(self._counts["unused"][:, KINDS.index(kind)], rows)

    def recent_counts(self, rows: Array) -> dict[str, Array]:
        """Return the counters of these rows, which `recent` knows, in the last 5 to 10 s that they sent something."""
        return self.recent.of(rows, self._counts)

    def count_rejected(self, reason: Reason, rows: Array) -> None:
        """Count one rejection for each entry of `rows`."""
        _count(self._counts["rejected"][:, REASONS.index(reason)], rows)

    def _grow(self, rows: int) -> None:
        self.arrivals.grow(rows)
        self.recent.grow(rows)
        if rows > len(self._counts):
            self._counts = enlarged(self._counts, 2 * len(self._counts))
            self._replay_lag_ns = enlarged(self._replay_lag_ns, len(self._counts))
            self._lag_ns = enlarged(self._lag_ns, len(self._counts))
            self._sites = enlarged(self._sites, len(self._counts))


def _count(column: Array, rows: Array) -> None:
    """Add one for every entry of `rows`. This is fast when equal entries stand side by side."""
    if len(rows) <= FEW:
        for row, count in Counter(rows.tolist()).items():
            column[row] += count
        return
    ends = np.concatenate([np.flatnonzero(rows[1:] != rows[:-1]), [len(rows) - 1]])
    counts = ends + 1
    counts[1:] -= counts[:-1].copy()
    np.add.at(column, rows[ends].astype(np.intp), counts.astype(column.dtype))


def _named(names: tuple[str, ...], counts: Array) -> Counter[str]:
    return Counter({str(name): int(count) for name, count in zip(names, counts, strict=True) if count})

"""Turn messages into poses: admit, read, fuse, store, and count what is lost."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

import numpy as np

from dropanchor_schemas.keys import InvalidKeyError
from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array, PoseBatch, SampleBatch
from dropanchor_service.ingest.admission import Admission
from dropanchor_service.ingest.backlog import ROW, Message
from dropanchor_service.ingest.buffer import MessageBuffer, UnregisteredMessage
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.health import HealthIntake
from dropanchor_service.ingest.host_clock import HostClock
from dropanchor_service.ingest.observers import NO_OBSERVERS, Observers
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.ingest.rejections import Rejections
from dropanchor_service.ingest.samples import OnGap, Ordered, SampleReader
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.store import LatestPoses, Sites, Tag

MESSAGES_PER_TURN = 1000


class Ingest:
    """The path of a message from the buffer to the stored pose. Owned by one thread.

    Any thread may call `announce` and `health.put`.
    reorder_ns: time that a message waits for those that its publisher numbered before it.
    """

    def __init__(
        self,
        buffer: MessageBuffer,
        admission: Admission,
        engine: GuardedEngine,
        publishers: Publishers,
        sites: Sites,
        latest: LatestPoses,
        metrics: Metrics,
        clock: UtcClock,
        observers: Observers = NO_OBSERVERS,
        reorder_ns: int = 250_000_000,
    ) -> None:
        self._rejections = Rejections(sites.rows, metrics)
        self.health = HealthIntake(admission, sites, self._rejections, buffer.wake)
        host = HostClock(clock, publishers, sites.rows, self._follow_clock)
        self._reader = SampleReader(sites, engine, self._rejections, publishers, host, reorder_ns)
        self._buffer = buffer
        self._admission = admission
        self._sites = sites
        self._registered_tags = 0  # rows whose keys are registered with the buffer
        self._forgotten: frozenset[int] = frozenset()  # rows of deleted tags, whose keys are no longer registered
        self._engine = engine
        self._publishers = publishers
        self._rows = sites.rows
        self._latest = latest
        self._metrics = metrics
        self._clock = clock
        self._observers = observers
        self._announced: deque[str] = deque(maxlen=1024)
        for site in sites:
            site.store.on_change.append(buffer.wake)

    def announce(self, key: str) -> None:
        """Admit the tag with this key, which is online, in the next turn. Thread-safe."""
        self._announced.append(key)
        self._buffer.wake()

    def ask_on_gap(self, on_gap: OnGap) -> None:
        """Offer messages behind a gap to `on_gap` from now on."""
        self._reader.on_gap = on_gap

    @property
    def has_pending(self) -> bool:
        """Return whether messages are pending, so that a turn may be due although nothing arrives."""
        return self._reader.pending > 0

    @property
    def span_s(self) -> float:
        """Return the least time that a message with samples spanned, of those that the last turn fused."""
        return self._reader.span_ns * 1e-9

    def turn(self, limit: int = MESSAGES_PER_TURN) -> int:
        """Process up to `limit` messages of registered tags. Return how many."""
        for site in self._engine.follow_sites():
            self._admission.register_listed(site)
        self._admission.review()
        self._admit_announced()
        self.health.turn()
        kept = list(self._register_new_tags())
        fresh, unregistered = self._buffer.drain(limit, self._clock.now_ns())
        self._count_shed()
        self._forget_deleted_tags()
        of_known, of_deleted = self._split(fresh)
        messages = [*kept, *of_known, *self._admitted([*of_deleted, *unregistered])]
        if messages or self.has_pending:
            now_ns = self._clock.now_ns()
            ordered = self._reader.put_in_order(messages, now_ns, self._buffer.behind)
            self._note(ordered.taken)
            self._fuse(ordered, now_ns)
        return len(fresh)

    def _follow_clock(self, by_ns: int) -> None:
        """Follow the service's clock, which was moved: nothing has waited for longer, and no pose is of the future."""
        self._buffer.move_arrivals(by_ns)
        self._reader.move_arrivals(by_ns)
        self._rows.arrivals.forget()
        if by_ns < 0:
            self._latest.move_future(self._clock.now_ns(), by_ns)
        self._metrics.host_clock.set(-self._clock.correction_ns * 1e-9)

    def _note(self, messages: list[Message]) -> None:
        """Count messages and show them to the observers."""
        if messages:
            self._notify(self._observers.messages, messages)
            self._metrics.messages.inc(len(messages))
            self._rows.count_messages(np.fromiter(map(ROW, messages), np.int32, len(messages)), messages[-1][3])

    def _admit_announced(self) -> None:
        while self._announced:
            with suppress(InvalidKeyError):
                self._admission.admit(*self._sites.of_key(self._announced.popleft()))

    def _register_new_tags(self) -> Iterator[Message]:
        """Register the keys of new tags with the buffer and prepare their rows. Yield the messages kept for them.

        From then on, their messages wait neither among those of unregistered tags nor for their estimator.
        """
        for tag in self._rows.all()[self._registered_tags :] if len(self._rows) > self._registered_tags else ():
            self._buffer.admit(self._sites.samples_key(tag.row), tag.row)
            self._engine.prepare(tag.row)
            self._registered_tags = tag.row + 1
            yield from self._kept(tag)

    def _forget_deleted_tags(self) -> None:
        """Let the messages of deleted tags wait among those of unregistered ones."""
        deleted = self._rows.deleted
        for row in deleted - self._forgotten:
            self._buffer.forget(self._sites.samples_key(row))
        self._forgotten = deleted

    def _split(self, fresh: list[Message]) -> tuple[list[Message], list[UnregisteredMessage]]:
        """Split off the messages of deleted tags, which have to be admitted like those of unknown tags."""
        if not self._forgotten:
            return fresh, []
        of_known = [message for message in fresh if message[0] not in self._forgotten]
        key_of = self._sites.samples_key
        of_deleted = [(key_of(message[0]), *message[1:]) for message in fresh if message[0] in self._forgotten]
        return of_known, of_deleted

    def _admitted(self, unregistered: Sequence[UnregisteredMessage]) -> Iterator[Message]:
        for message in unregistered:
            key, payload, encoding, arrival_ns = message
            row = self._buffer.row_of(key)
            if row is None:
                tag = self._admission.admit_message(message)
                if isinstance(tag, Reason):
                    self._rejections.count_refused(tag, key)
                if not isinstance(tag, Tag):
                    continue
                self._buffer.admit(key, tag.row)
                yield from self._kept(tag)
                row = tag.row
            yield row, payload, encoding, arrival_ns

    def _kept(self, tag: Tag) -> Iterator[Message]:
        for payload, encoding, arrival_ns in self._admission.take_kept(tag):
            yield tag.row, payload, encoding, arrival_ns

    def _fuse(self, ordered: Ordered, now_ns: int) -> None:
        for samples in self._reader.batches(ordered):
            self._fuse_batch(self._outside_quarantine(samples, now_ns), now_ns)
        if ordered.taken:
            self._metrics.delay_seconds.observe((self._clock.now_ns() - ordered.taken[0][3]) * 1e-9)

    def _fuse_batch(self, samples: SampleBatch, now_ns: int) -> None:
        for kind, column in zip(KINDS, samples.columns(), strict=True):
            if len(column):
                self._rows.count_samples(kind.name, column["row"])
                self._metrics.samples.labels(kind.name).inc(len(column))
        if not any(map(len, samples.columns())):
            return
        self._notify(self._publishers.compare_clocks, samples, now_ns)
        started = time.perf_counter()
        for poses in self._engine.process(samples, now_ns):
            self._store(poses)
        self._metrics.estimator_seconds.observe(time.perf_counter() - started)

    def _outside_quarantine(self, samples: SampleBatch, now_ns: int) -> SampleBatch:
        if not self._engine.quarantine.holds_any(now_ns):
            return samples
        columns = zip(KINDS, samples.columns(), strict=True)
        return SampleBatch(*(self._accepted(column, kind.name, now_ns) for kind, column in columns))

    def _accepted(self, column: Array, kind: str, now_ns: int) -> Array:
        quarantined = self._engine.quarantine.holds(column["row"], now_ns)
        self._rejections.count_rejected(Reason.ESTIMATOR_FAULT, column["row"][quarantined], kind)
        accepted: Array = column[~quarantined] if quarantined.any() else column
        return accepted

    def _store(self, batch: PoseBatch) -> None:
        for outcomes in (batch.poses, batch.innovations):
            self._publishers.to_utc(outcomes)
        self._latest.write(batch.poses, batch.hypotheses, batch.innovations)
        for row in self._rows.deleted.intersection(batch.poses["row"].tolist()):
            self._latest.forget(row)  # the samples were pending when the tag was deleted
        self._metrics.poses.inc(len(batch.poses))
        for kind, rows in batch.unused.items():
            self._rows.count_unused(kind, rows)
        for reason, rows in batch.rejected.items():
            self._rejections.count_rejected(Reason(reason), rows)
        self._rows.set_lag(batch.lags)
        self._notify(self._observers.poses, batch.poses)

    def _notify(self, observer: Callable[..., None], *values: object) -> None:
        """Call an observer. If it fails, no sample is lost."""
        try:
            observer(*values)
        except Exception as error:
            self._rejections.observer_failed(error)

    def _count_shed(self) -> None:
        by_row, samples, unregistered = self._buffer.take_shed()
        self._rejections.count_unregistered(Reason.SHED, unregistered)
        self._rejections.count_unregistered(Reason.TAG_UNCONFIRMED, self._admission.take_expired())
        if by_row:
            rows = np.fromiter(by_row, np.int64, len(by_row))
            times = np.fromiter(by_row.values(), np.int64, len(by_row))
            self._rejections.count_shed(np.repeat(rows, times), samples)
            self._publishers.allow_gap(rows)

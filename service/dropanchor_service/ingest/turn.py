"""From messages to poses: admit, prepare, fuse, store, and count whatever is lost."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array, PoseBatch, SampleBatch
from dropanchor_service.ingest.admission import Admission
from dropanchor_service.ingest.buffer import Message, MessageBuffer, UnregisteredMessage
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.observers import NO_OBSERVERS, Observers
from dropanchor_service.ingest.rejections import Rejections
from dropanchor_service.ingest.samples import SampleReader
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.store import LatestPoses, SiteStore, Tag, TagTable

MESSAGES_PER_TURN = 1000


class Ingest:
    """Owned by one thread, except for `announce`."""

    def __init__(
        self,
        buffer: MessageBuffer,
        admission: Admission,
        engine: GuardedEngine,
        site: SiteStore,
        tags: TagTable,
        latest: LatestPoses,
        metrics: Metrics,
        clock: UtcClock,
        observers: Observers = NO_OBSERVERS,
        reorder_ns: int = 250_000_000,
    ) -> None:
        self._rejections = Rejections(tags, metrics)
        self.reader = SampleReader(site, tags, engine, self._rejections, reorder_ns)
        self._buffer = buffer
        self._admission = admission
        self._site = site
        self._known_tags = 0  # rows whose keys the buffer knows
        self._engine = engine
        self._tags = tags
        self._latest = latest
        self._metrics = metrics
        self._clock = clock
        self._observers = observers
        self._announced: deque[str] = deque(maxlen=1024)

    def announce(self, name: str) -> None:
        """A tag has said that it is alive. From any thread."""
        self._announced.append(name)

    @property
    def has_pending(self) -> bool:
        """Whether a message waits for one before it, so that a turn may be due although nothing comes in."""
        return self.reader.has_pending > 0

    def turn(self, most: int = MESSAGES_PER_TURN) -> int:
        """So many of the messages that wait, at most. Returns how many of tags that are known were taken."""
        if self._engine.follow_site():
            self._admission.register_listed()
        self._admission.review()
        while self._announced:
            self._admission.by_name(self._announced.popleft())
        waited = list(self._know_new_tags())
        fresh, strangers = self._buffer.drain(most, self._clock.now_ns())
        self._count_shed()
        known = [*waited, *fresh, *self._admitted(strangers)]
        if known:
            self._tell(self._observers.messages, known)
            self._metrics.messages.inc(len(known))
            self._tags.count_messages(np.array([message[0] for message in known], np.int32), known[-1][3])
        if known or self.has_pending:
            self._fuse(known)
        return len(fresh)

    def _know_new_tags(self) -> Iterator[Message]:
        """Messages of tags that have a row already wait neither among those of strangers nor for their estimator.
        Returns what waited of tags that others gave a row."""
        for tag in self._tags.all()[self._known_tags :] if len(self._tags) > self._known_tags else ():
            self._buffer.admit(samples_key(self._site.site.id, tag.name), tag.row)
            self._engine.make_ready(tag.row)
            self._known_tags = tag.row + 1
            yield from self._waited(tag)

    def _admitted(self, strangers: Sequence[UnregisteredMessage]) -> Iterator[Message]:
        for stranger in strangers:
            key, payload, encoding, arrival_ns = stranger
            row = self._buffer.row_of(key)
            if row is None:
                tag = self._admission.hear(stranger)
                if isinstance(tag, Reason):
                    self._rejections.refuse(tag, key)
                if not isinstance(tag, Tag):
                    continue
                self._buffer.admit(key, tag.row)
                yield from self._waited(tag)
                row = tag.row
            yield row, payload, encoding, arrival_ns

    def _waited(self, tag: Tag) -> Iterator[Message]:
        for payload, encoding, arrival_ns in self._admission.waited(tag):
            yield tag.row, payload, encoding, arrival_ns

    def _fuse(self, messages: list[Message]) -> None:
        now_ns = self._clock.now_ns()
        for samples in self.reader.batches_of(messages, now_ns):
            self._fuse_batch(self._outside_quarantine(samples, now_ns), now_ns)
        if messages:
            self._metrics.delay_seconds.observe((self._clock.now_ns() - messages[0][3]) * 1e-9)

    def _fuse_batch(self, samples: SampleBatch, now_ns: int) -> None:
        for kind, column in _by_kind(samples):
            if len(column):
                self._tags.count_samples(kind, column["row"])
                self._metrics.samples.labels(kind).inc(len(column))
        if not any(len(column) for _, column in _by_kind(samples)):
            return
        started = time.perf_counter()
        for poses in self._engine.process(samples, now_ns):
            self._store(poses)
        self._metrics.estimator_seconds.observe(time.perf_counter() - started)

    def _outside_quarantine(self, samples: SampleBatch, now_ns: int) -> SampleBatch:
        if not self._engine.any_quarantined(now_ns):
            return samples
        free: dict[str, Array] = {}
        for kind, column in _by_kind(samples):
            shut = self._engine.quarantined(column["row"], now_ns)
            self._rejections.reject(Reason.ESTIMATOR_FAULT, column["row"][shut])
            free[kind] = column[~shut] if shut.any() else column
        return SampleBatch(free["imu"], free["range"], free["heading"], free["bearing"])

    def _store(self, batch: PoseBatch) -> None:
        for outcomes in (batch.poses, batch.innovations):
            self.reader.publishers.to_utc(outcomes)
        self._latest.write(batch.poses, batch.hypotheses, batch.innovations)
        self._metrics.poses.inc(len(batch.poses))
        for reason, count in batch.rejected.items():
            self._metrics.rejected.labels(reason).inc(count)
        self._tell(self._observers.poses, batch.poses)

    def _tell(self, tap: Callable[..., None], *what: object) -> None:
        """What only listens must not cost a sample."""
        try:
            tap(*what)
        except Exception as error:
            self._rejections.observer_failed(error)

    def _count_shed(self) -> None:
        by_row, samples, strangers = self._buffer.take_shed()
        self._rejections.count_unregistered(Reason.SHED, strangers)
        self._rejections.count_unregistered(Reason.TAG_UNPROVEN, self._admission.take_expired())
        if by_row:
            rows = np.fromiter(by_row, np.int64, len(by_row))
            times = np.fromiter(by_row.values(), np.int64, len(by_row))
            self._rejections.shed(np.repeat(rows, times), samples)
            self.reader.publishers.allow_gap(rows)


def _by_kind(samples: SampleBatch) -> tuple[tuple[str, Array], ...]:
    return (
        ("imu", samples.imu),
        ("range", samples.ranges),
        ("heading", samples.headings),
        ("bearing", samples.bearings),
    )

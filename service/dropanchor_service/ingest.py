"""From messages to poses: decode, drop duplicates, screen, map clocks, fuse, store, and count whatever is lost."""

import logging
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dropanchor_schemas.wire import Reason
from dropanchor_service.admission import Admission
from dropanchor_service.buffer import MessageBuffer, Received
from dropanchor_service.clock import Publishers, UtcClock
from dropanchor_service.decode import Decoded, decode
from dropanchor_service.estimation.batch import BEARING, HEADING, RANGE, Array, PoseBatch, SampleBatch
from dropanchor_service.estimators import Estimators
from dropanchor_service.logs import RareLog
from dropanchor_service.metrics import Metrics
from dropanchor_service.screening import Rejected, keep, screen, within_time
from dropanchor_service.store import LatestPoses, SiteStore, TagTable
from dropanchor_service.taps import NO_TAPS, Taps

MESSAGES_PER_TURN = 1000


class Ingest:
    """Owned by one thread, except for `announce`."""

    def __init__(
        self,
        buffer: MessageBuffer,
        admission: Admission,
        estimators: Estimators,
        site: SiteStore,
        tags: TagTable,
        latest: LatestPoses,
        metrics: Metrics,
        clock: UtcClock,
        taps: Taps = NO_TAPS,
    ) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._buffer = buffer
        self._admission = admission
        self._estimators = estimators
        self._site = site
        self._tags = tags
        self._latest = latest
        self._metrics = metrics
        self._clock = clock
        self._taps = taps
        self._publishers = Publishers()
        self._rows: dict[str, int] = {}  # by key
        self._announced: deque[str] = deque(maxlen=1024)

    def announce(self, name: str) -> None:
        """A tag has said that it is alive. From any thread."""
        self._announced.append(name)

    def turn(self) -> None:
        """Everything that waits, up to MESSAGES_PER_TURN."""
        if self._estimators.follow_site():
            self._admission.register_listed()
        while self._announced:
            self._admission.by_name(self._announced.popleft())
        self._count_shed()
        messages = self._buffer.drain(MESSAGES_PER_TURN)
        if messages:
            self._take(messages)

    def _take(self, messages: Sequence[Received]) -> None:
        rows = [self._row(message) for message in messages]
        admitted = [(row, message) for row, message in zip(rows, messages, strict=True) if row >= 0]
        if not admitted:
            return
        self._tell(self._taps.messages, [row for row, _ in admitted], [message for _, message in admitted])
        of_row = np.array([row for row, _ in admitted], np.int32)
        arrivals = np.array([message[3] for _, message in admitted], np.int64)
        self._metrics.messages.inc(len(admitted))
        self._tags.count_messages(of_row, int(arrivals[-1]))
        decoded = self._decoded([message for _, message in admitted])
        for reason in {reason for _, reason in decoded.rejected}:
            indices = [index for index, why in decoded.rejected if why == reason]
            self._reject(reason, of_row[indices])
        self._fuse(self._prepared(decoded, of_row, arrivals), int(arrivals[0]))

    def _row(self, message: Received) -> int:
        """-1: the tag is not admitted."""
        key = message[0]
        row = self._rows.get(key)
        if row is not None:
            return row
        tag = self._admission.by_key(key)
        if isinstance(tag, Reason):
            self._metrics.rejected.labels(tag).inc()
            self._log.warning(f"message refused ({tag})", key[:200])
            return -1
        self._rows[key] = tag.row
        self._buffer.admit([key])
        return tag.row

    def _decoded(self, messages: Sequence[Received]) -> Decoded:
        """A payload that the decoder fails on, which is an error of ours, costs nothing but itself."""
        payloads, encodings = [message[1] for message in messages], [message[2] for message in messages]
        try:
            return decode(payloads, encodings)
        except Exception as error:
            self._metrics.faults.labels("decoder").inc()
            self._log.exception("decoder", error)
            return decode([_if_decodable(*pair) for pair in zip(payloads, encodings, strict=True)], encodings)

    def _prepared(self, decoded: Decoded, of_row: Array, arrivals: Array) -> SampleBatch:
        decoded = self._without_duplicates(decoded, of_row)
        decoded, rejected = screen(decoded)
        self._map_clocks(decoded, of_row, arrivals)
        decoded = self._without_impossible_times(decoded, rejected)
        self._bind_first_anchor(decoded)
        ranges = self._anchored(decoded.ranges, rejected)
        bearings = self._anchored(decoded.bearings, rejected)
        for entry in rejected:
            self._reject(entry.reason, of_row[entry.messages])
        imu = decoded.imu
        imu["row"] = of_row[imu["row"]]
        return SampleBatch(
            imu=imu,
            ranges=_batch(ranges, RANGE, "range", of_row),
            headings=_batch(decoded.headings, HEADING, "heading", of_row),
            bearings=_batch(bearings, BEARING, "bearing", of_row),
        )

    def _without_duplicates(self, decoded: Decoded, of_row: Array) -> Decoded:
        forms = decoded.forms
        again = np.zeros(len(forms), bool)
        numbered = np.flatnonzero(forms["numbered"])
        for index, row, boot_id, sequence in zip(
            numbered.tolist(),
            of_row[numbered].tolist(),
            forms["boot_id"][numbered].tolist(),
            forms["sequence"][numbered].tolist(),
            strict=True,
        ):
            again[index] = not self._publishers.of(row, boot_id).is_new(sequence)
        if not again.any():
            return decoded
        self._reject(Reason.DUPLICATE, of_row[again])
        return replace(
            decoded,
            imu=decoded.imu[~again[decoded.imu["row"]]],
            ranges=decoded.ranges[~again[decoded.ranges["message"]]],
            headings=decoded.headings[~again[decoded.headings["message"]]],
            bearings=decoded.bearings[~again[decoded.bearings["message"]]],
        )

    def _map_clocks(self, decoded: Decoded, of_row: Array, arrivals: Array) -> None:
        """Times of publishers that count from the start of the tag become UTC, in place."""
        boot = decoded.forms["boot_clock"]
        if not boot.any():
            return
        newest = np.full(len(boot), -1, np.int64)
        for messages, samples in _by_message(decoded):
            np.maximum.at(newest, messages, samples["t_ns"])
        offsets = np.zeros(len(boot), np.int64)
        for index in np.flatnonzero(boot & (newest >= 0)).tolist():
            publisher = self._publishers.of(int(of_row[index]), int(decoded.forms["boot_id"][index]))
            offsets[index] = publisher.utc_offset_ns(int(newest[index]), int(arrivals[index]))
        for messages, samples in _by_message(decoded):
            samples["t_ns"] += offsets[messages]

    def _without_impossible_times(self, decoded: Decoded, rejected: list[Rejected]) -> Decoded:
        imu, ranges, headings, bearings = (
            keep(samples, messages, ~within_time(samples["t_ns"]), Reason.TIME_OUT_OF_RANGE, rejected)
            for messages, samples in _by_message(decoded)
        )
        return replace(decoded, imu=imu, ranges=ranges, headings=headings, bearings=bearings)

    def _bind_first_anchor(self, decoded: Decoded) -> None:
        """A site without anchors takes the first one that is heard as its origin."""
        if self._site.site.anchors or len(decoded.ranges) == 0:
            return
        number = int(decoded.ranges["anchor"][0])
        if self._site.bind_first(decoded.anchor_names.get(number, str(number))):
            self._estimators.follow_site()

    def _anchored(self, samples: Array, rejected: list[Rejected]) -> Array:
        """The samples of anchors that the site has, with the engine's index of the anchor in `anchor`."""
        indices = self._estimators.anchor_indices(samples["anchor"])
        unknown = indices < 0
        kept = keep(samples, samples["message"], unknown, Reason.ANCHOR_UNKNOWN, rejected)
        kept["anchor"] = indices[~unknown]
        return kept

    def _fuse(self, samples: SampleBatch, arrival_ns: int) -> None:
        now_ns = self._clock.now_ns()
        samples = self._outside_quarantine(samples, now_ns)
        for kind, column in _by_kind(samples):
            self._tags.count_samples(kind, column["row"])
            self._metrics.samples.labels(kind).inc(len(column))
        if not any(len(column) for _, column in _by_kind(samples)):
            return
        started = time.perf_counter()
        for poses in self._estimators.process(samples, now_ns):
            self._store(poses)
        self._metrics.estimator_seconds.observe(time.perf_counter() - started)
        self._metrics.delay_seconds.observe((self._clock.now_ns() - arrival_ns) * 1e-9)

    def _outside_quarantine(self, samples: SampleBatch, now_ns: int) -> SampleBatch:
        free: dict[str, Array] = {}
        for kind, column in _by_kind(samples):
            shut = self._estimators.quarantined(column["row"], now_ns)
            self._reject(Reason.ESTIMATOR_FAULT, column["row"][shut])
            free[kind] = column[~shut] if shut.any() else column
        return SampleBatch(free["imu"], free["range"], free["heading"], free["bearing"])

    def _store(self, batch: PoseBatch) -> None:
        self._latest.write(batch.poses, batch.hypotheses, batch.innovations)
        self._metrics.poses.inc(len(batch.poses))
        for reason, count in batch.rejected.items():
            self._metrics.rejected.labels(reason).inc(count)
        self._tell(self._taps.poses, batch.poses)

    def _tell(self, tap: Callable[..., None], *what: object) -> None:
        """What only listens must not cost a sample."""
        try:
            tap(*what)
        except Exception as error:
            self._metrics.faults.labels("tap").inc()
            self._log.exception("tap", error)

    def _reject(self, reason: Reason, rows: Array) -> None:
        if len(rows):
            self._tags.count_rejected(reason, rows)
            self._metrics.rejected.labels(reason).inc(len(rows))

    def _count_shed(self) -> None:
        by_key, strangers = self._buffer.take_shed()
        if strangers:
            self._metrics.rejected.labels(Reason.SHED).inc(strangers)
        for key, count in by_key.items():
            self._reject(Reason.SHED, np.repeat(self._rows[key], count))


def _if_decodable(payload: bytes, encoding: str) -> bytes:
    """Nothing, which is refused by name, in the place of a payload that the decoder fails on."""
    try:
        decode([payload], [encoding])
    except Exception:
        return b""
    return payload


def _by_message(decoded: Decoded) -> tuple[tuple[Array, Array], ...]:
    """The index of the payload of each sample, and the samples, of every kind."""
    scalars = (decoded.ranges, decoded.headings, decoded.bearings)
    return (decoded.imu["row"], decoded.imu), *((samples["message"], samples) for samples in scalars)


def _by_kind(samples: SampleBatch) -> tuple[tuple[str, Array], ...]:
    return (
        ("imu", samples.imu),
        ("range", samples.ranges),
        ("heading", samples.headings),
        ("bearing", samples.bearings),
    )


def _batch(scalars: Array, dtype: np.dtype[np.void], value: str, of_row: Array) -> Array:
    """Screened SCALAR as the columns of an engine."""
    batch = np.empty(len(scalars), dtype)
    batch["row"], batch["t_ns"] = of_row[scalars["message"]], scalars["t_ns"]
    batch[value], batch["std"] = scalars["value"], scalars["std"]
    if "anchor" in (dtype.names or ()):
        batch["anchor"] = scalars["anchor"]
    return batch

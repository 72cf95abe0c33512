"""Turn messages of admitted tags into samples for an engine: decode, put in order, screen, map clocks."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.kinds import KINDS, SCALARS, Kind
from dropanchor_schemas.wire import MAX_T_NS, Reason
from dropanchor_service.estimation.columns import IMU, Array, SampleBatch
from dropanchor_service.ingest.backlog import Message
from dropanchor_service.ingest.decode import Decoded, Forms, read_forms, read_samples
from dropanchor_service.ingest.due import due_of_each
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.kernels.values import time_spans
from dropanchor_service.ingest.publishers import Publishers, Sequenced
from dropanchor_service.ingest.rejections import Rejections
from dropanchor_service.ingest.reorder_buffer import ReorderBuffer
from dropanchor_service.ingest.screening import Rejected, absurd_imu, keep, screen
from dropanchor_service.ingest.times import in_time, times_of
from dropanchor_service.store import Sites
from dropanchor_service.store.arrivals import Arrived
from dropanchor_service.store.rings import rank_in_row
from dropanchor_service.store.rows import MESSAGE

REORDER_BYTES = 2**26
_DTYPES = [column.dtype for column in SampleBatch().columns()]

OnGap = Callable[[str, list[Message]], bool]
"""Takes messages of the tag with this key that came before one with a smaller number, and appends them to the buffer
again once that one cannot come any more. Returns whether it does so."""


@dataclass(frozen=True)
class Ordered:
    """Messages in the order of their publishers, as `SampleReader.batches` takes them.

    taken: messages that `on_gap` has not kept. of_row, arrived: of all messages in `forms`, which may have waited.
    """

    taken: list[Message]
    forms: Forms
    sequenced: Sequenced
    of_row: Array
    arrived: Array


class _Spans(NamedTuple):
    """The times of the oldest and the newest sample of each message, and of the newest of each kind; -1 for none."""

    oldest: Array
    newest: Array
    newest_of: Array  # (kinds, messages)


class SampleReader:
    """Reads the samples of messages, in the order of each publisher. Owned by one thread.

    window_ns: time that a message waits for those that its publisher numbered before it.
    span_ns: between the oldest and the newest sample of a message: the least of the last batch.
    on_gap: is offered messages behind a gap. Those that it does not take wait here.
    """

    def __init__(
        self,
        sites: Sites,
        engine: GuardedEngine,
        rejections: Rejections,
        publishers: Publishers,
        window_ns: int,
    ) -> None:
        self.window_ns = window_ns
        self.span_ns = 0
        self.on_gap: OnGap = lambda *_: False
        self._publishers = publishers
        self._sites = sites
        self._rows = sites.rows
        self._engine = engine
        self._rejections = rejections
        self._reorder = ReorderBuffer(REORDER_BYTES)

    @property
    def pending(self) -> int:
        """Number of messages that wait for one numbered before them."""
        return len(self._reorder)

    def put_in_order(self, fresh: list[Message], now_ns: int, behind: Collection[int] = ()) -> Ordered:
        """Find the messages that are due, fresh or pending, and let the others wait. behind: see `due_of_each`."""
        due_ns, is_full = self._due_ns(fresh, now_ns), self._reorder.is_full
        messages = [*self._reorder.take_due(fresh, due_ns), *fresh] if self.pending else fresh
        rows, payloads, encodings, arrivals = zip(*messages, strict=True) if messages else ((), (), (), ())
        read = self._forms(payloads, encodings)
        of_row, arrived = np.array(rows, np.int32), np.array(arrivals, np.int64)
        for reason in {reason for _, reason in read.rejected}:
            refused = [index for index, why in read.rejected if why == reason]
            self._rejections.count_rejected(reason, of_row[refused], MESSAGE)
        waited = len(messages) - len(fresh)
        due_of = due_ns if is_full else due_of_each(due_ns, self.window_ns, of_row, arrived, waited, behind)
        sequenced = self._publishers.sequence(read.forms, of_row, arrived, due_of, waited)
        self._rejections.count_given_up(sequenced.missing)
        self._rejections.count_restarts(sequenced.restarts)
        self._rejections.count_rejected(Reason.DUPLICATE, of_row[sequenced.duplicates])
        waiting = sequenced.pending.tolist()
        kept = self._kept_on_gap([index for index in waiting if index >= waited], messages) if waiting else set()
        self._reorder.add([messages[index] for index in waiting if index not in kept])
        taken = [messages[index] for index in range(waited, len(messages)) if index not in kept] if kept else fresh
        return Ordered(taken, read, sequenced, of_row, arrived)

    def _kept_on_gap(self, waiting: list[int], messages: list[Message]) -> set[int]:
        """Offer fresh messages behind a gap to `on_gap`. Return those that it keeps, as indices."""
        by_row: dict[int, list[int]] = {}
        for index in waiting:
            by_row.setdefault(messages[index][0], []).append(index)
        key_of, kept = self._sites.samples_key, set[int]()
        for row, of_tag in by_row.items():
            if self.on_gap(key_of(row), [messages[index] for index in of_tag]):
                kept.update(of_tag)
        return kept

    def batches(self, ordered: Ordered) -> Iterator[SampleBatch]:
        """Yield the samples of the messages that are due.

        A batch holds at most one message of each tag, so that the result for a message does not depend on which others
        arrived with it.
        """
        read, sequenced, of_row, arrived = ordered.forms, ordered.sequenced, ordered.of_row, ordered.arrived
        for due in _one_per_row(sequenced.due, of_row):
            sent = read_samples(read, due)
            self._engine.convert(sent, of_row)
            decoded, rejected = screen(sent)
            self._note_absurd(sent, rejected, of_row)
            of_batch = replace(sequenced, due=due)
            offsets = self._publishers.time_offsets(read.forms, of_batch, arrived, times_of(decoded))
            self._rejections.count_clock_jumps(offsets.jumps)
            for row in of_row[offsets.restarts].tolist():
                self._engine.restart(row)
            timed, early = in_time(decoded, offsets, rejected)
            for samples in early:
                samples.record(self._rows, of_row, arrived)
            spans = _spans(timed)
            self._note_replays(timed, due, of_row, arrived, spans.newest)
            yield self._batch(timed, rejected, due, of_row, arrived, spans)

    def _note_absurd(self, sent: Decoded, rejected: list[Rejected], of_row: Array) -> None:
        """Tell the check of the sensors about values that no sensor measures: they look like another unit."""
        if {entry.reason for entry in rejected}.isdisjoint((Reason.IMU_ABSURD, Reason.RANGE_ABSURD)):
            return
        imu, sizes = absurd_imu(sent.imu)
        ranges = [entry.messages for entry in rejected if entry.reason == Reason.RANGE_ABSURD]
        far = np.concatenate([np.empty(0, np.int64), *ranges])
        self._engine.note_absurd(of_row[imu["message"]], sizes, of_row[far])

    def _due_ns(self, fresh: list[Message], now_ns: int) -> int:
        """Return the arrival until which pending messages have waited long enough.

        The window is measured in arrivals, not in time: in a backlog, the missing message may be among the next ones.
        """
        if self._reorder.is_full:
            return now_ns
        return min(now_ns, max((message[3] for message in fresh), default=now_ns)) - self.window_ns

    def _forms(self, payloads: Sequence[bytes], encodings: Sequence[str]) -> Forms:
        """Return the forms of these payloads. A payload that makes the decoder fail is read as an empty one."""
        try:
            return read_forms(payloads, encodings)
        except Exception as error:
            self._rejections.decoder_failed(error)
            return read_forms([_if_readable(*pair) for pair in zip(payloads, encodings, strict=True)], encodings)

    def _note_replays(self, decoded: Decoded, due: Array, of_row: Array, arrived: Array, newest: Array) -> None:
        """Record how far the newest sample of a replay lies before its arrival.

        Answers subtract it from the age of the poses of a replay. The times of samples do not depend on it.
        """
        replayed = decoded.forms["replay"][due] & (newest[due] >= 0)
        self._rows.set_replay_lag(of_row[due], np.where(replayed, arrived[due] - newest[due], 0))

    def _note_arrivals(
        self, decoded: Decoded, ranges: Array, due: Array, of_row: Array, arrived: Array, spans: _Spans
    ) -> None:
        """Record when the samples of live tags arrived. ranges: those to anchors of the site."""
        oldest, newest, newest_of = spans
        filled = due[newest[due] >= 0]
        self.span_ns = int((newest[filled] - oldest[filled]).min(initial=MAX_T_NS))
        live = filled[~decoded.forms["replay"][filled].astype(bool)]
        counts = np.bincount(ranges["message"], minlength=len(of_row))
        zeros = np.bincount(ranges["message"][ranges["value"] == 0.0], minlength=len(of_row))
        times = (arrived[live], oldest[live], newest[live], newest_of[:, live])
        self._rows.arrivals.record(Arrived(of_row[live], *times, counts[live], zeros[live]))

    def _batch(
        self,
        decoded: Decoded,
        rejected: list[Rejected],
        due: Array,
        of_row: Array,
        arrived: Array,
        spans: _Spans,
    ) -> SampleBatch:
        self._note_unknown_anchors(decoded, of_row, arrived)
        scalars = [
            self._anchored(column, kind, of_row, rejected) if kind.has_anchor else column
            for kind, column in zip(SCALARS, decoded.columns()[1:], strict=True)
        ]
        self._note_arrivals(decoded, scalars[0], due, of_row, arrived, spans)
        for entry in rejected:
            self._rejections.count_rejected(entry.reason, of_row[entry.messages], entry.kind)
        return SampleBatch(
            _imu_column(decoded.imu, of_row),
            *(_column(column, dtype, of_row) for column, dtype in zip(scalars, _DTYPES[1:], strict=True)),
        )

    def _note_unknown_anchors(self, decoded: Decoded, of_row: Array, arrived: Array) -> None:
        """Record ranges to anchors that their sites do not have. A site without anchors gets the first one."""
        unknown = self._of_unknown_anchors(decoded.ranges, of_row)
        if not len(unknown):
            return
        if self._bind_first_anchors(unknown, decoded.anchor_names, of_row):
            unknown = self._of_unknown_anchors(unknown, of_row)
        messages, first = np.unique(unknown["message"], return_index=True)
        for message, number in zip(messages.tolist(), unknown["anchor"][first].tolist(), strict=True):
            name, tag = decoded.anchor_names.get(number, str(number)), self._rows.at(int(of_row[message]))
            anchors = self._sites[tag.site].tags.unknown_anchors
            anchors.record(tag.row, tag.name, number, name, int(arrived[message]))

    def _bind_first_anchors(self, ranges: Array, names: Mapping[int, str], of_row: Array) -> bool:
        """Make the first anchor that a tag ranges to the origin of its site. Return whether a site got one.

        ranges: to unknown anchors. names: of anchors, by number.
        """
        of_site, first = np.unique(self._rows.sites(of_row[ranges["message"]]), return_index=True)
        numbers = zip(of_site.tolist(), ranges["anchor"][first].tolist(), strict=True)
        bound = [self._sites[site].store.bind_first(names.get(number, str(number))) for site, number in numbers]
        if any(bound):
            self._engine.follow_sites()
        return any(bound)

    def _of_unknown_anchors(self, samples: Array, of_row: Array) -> Array:
        unknown = self._indices(samples, of_row) < 0
        found: Array = samples[unknown] if unknown.any() else samples[:0]
        return found

    def _indices(self, samples: Array, of_row: Array) -> Array:
        """Return the engine's index of the anchor of each sample, -1 if the site of its tag lacks it."""
        return self._engine.anchor_indices(of_row[samples["message"]], samples["anchor"])

    def _anchored(self, samples: Array, kind: Kind, of_row: Array, rejected: list[Rejected]) -> Array:
        """Return the samples of known anchors, with the engine's index of the anchor in `anchor`."""
        if not len(samples):
            return samples
        indices = self._indices(samples, of_row)
        unknown = indices < 0
        kept = keep(samples, unknown, Reason.ANCHOR_UNKNOWN, kind.name, rejected)
        kept["anchor"] = indices[~unknown]
        return kept


def _if_readable(payload: bytes, encoding: str) -> bytes:
    """Return the payload, or an empty one, which is rejected, if the decoder fails on it."""
    try:
        read_forms([payload], [encoding])
    except Exception:
        return b""
    return payload


def _one_per_row(due: Array, of_row: Array) -> list[Array]:
    """Split the indices `due` into parts that hold each row at most once, in the order of each row."""
    ranks = rank_in_row(of_row[due])
    return [due[ranks == rank] for rank in range(int(ranks.max(initial=-1)) + 1)]


def _spans(decoded: Decoded) -> _Spans:
    messages = len(decoded.forms)
    oldest, newest_of = np.full(messages, MAX_T_NS, np.int64), np.full((len(KINDS), messages), -1, np.int64)
    for (indices, t_ns), newest in zip(times_of(decoded), newest_of, strict=True):
        time_spans(t_ns, indices, oldest, newest)
    return _Spans(oldest, newest_of.max(axis=0), newest_of)


def _imu_column(samples: Array, of_row: Array) -> Array:
    """Convert IMU_SAMPLE to the IMU column of the engine, in place."""
    imu = samples.view(IMU)
    imu["row"] = of_row[samples["message"]]
    return imu


def _column(scalars: Array, dtype: "np.dtype[np.void]", of_row: Array) -> Array:
    """Convert SCALAR to a column of the engine, with this dtype."""
    column = np.empty(len(scalars), dtype)
    if not len(scalars):
        return column
    names = dtype.names or ()
    column["row"], column["t_ns"] = of_row[scalars["message"]], scalars["t_ns"]
    column[names[-2]], column["std"] = scalars["value"], scalars["std"]
    if "anchor" in names:
        column["anchor"] = scalars["anchor"]
    return column

"""Turn messages of admitted tags into samples for an engine: decode, put in order, screen, map clocks."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import starmap
from operator import is_

import numpy as np

from dropanchor_schemas.kinds import PRESSURE, SCALARS, BearingSample, Kind, RangeSample
from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array, SampleBatch
from dropanchor_service.ingest.backlog import ARRIVAL, Message
from dropanchor_service.ingest.batch import Batch, Spans, engine_columns, spans_of, times_of
from dropanchor_service.ingest.decode import Forms, read_forms, read_samples
from dropanchor_service.ingest.doubtful import Doubtful
from dropanchor_service.ingest.due import due_of_each, one_per_row
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.host_clock import HostClock
from dropanchor_service.ingest.kernels.arrivals import record_arrivals
from dropanchor_service.ingest.messages import Messages
from dropanchor_service.ingest.publishers import Publishers, Sequenced
from dropanchor_service.ingest.rejections import Rejections
from dropanchor_service.ingest.reorder_buffer import ReorderBuffer
from dropanchor_service.ingest.screening import absurd_imu, keep, screen
from dropanchor_service.ingest.times import in_time
from dropanchor_service.store import Sites
from dropanchor_service.store.rows import MESSAGE

REORDER_BYTES = 2**26

OnGap = Callable[[str, list[Message]], bool]
"""Takes messages of the tag with this key that came before one with a smaller number, and appends them to the buffer
again once that one cannot come any more. Returns whether it does so."""


@dataclass(frozen=True)
class Ordered:
    """Messages in the order of their publishers, as `SampleReader.batches` takes them.

    taken: messages that `on_gap` has not kept.
    """

    taken: list[Message]
    messages: Messages
    sequenced: Sequenced


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
        host: HostClock,
        window_ns: int,
    ) -> None:
        self.window_ns = window_ns
        self.span_ns = 0
        self.on_gap: OnGap = lambda *_: False
        self._publishers = publishers
        self._host = host
        self._sites = sites
        self._rows = sites.rows
        self._engine = engine
        self._rejections = rejections
        self._doubtful = Doubtful(publishers)
        self._reorder = ReorderBuffer(REORDER_BYTES)

    @property
    def pending(self) -> int:
        """Number of messages that wait for one numbered before them."""
        return len(self._reorder)

    def move_arrivals(self, by_ns: int) -> None:
        """Follow the service's clock, which was moved."""
        self._reorder.move_arrivals(by_ns)

    def put_in_order(self, fresh: list[Message], now_ns: int, behind: Collection[int] = ()) -> Ordered:
        """Find the messages that are due, fresh or pending, and let the others wait. behind: see `due_of_each`."""
        due_ns, is_full = self._due_ns(fresh, now_ns), self._reorder.is_full
        messages = [*self._reorder.take_due(fresh, due_ns), *fresh] if self.pending else fresh
        rows, payloads, encodings, arrivals = zip(*messages, strict=True) if messages else ((), (), (), ())
        of_turn = Messages(
            self._forms(payloads, encodings),
            np.array(rows, np.int32),
            np.array(arrivals, np.int64),
            waited=len(messages) - len(fresh),
        )
        due_of = due_ns if is_full else due_of_each(due_ns, self.window_ns, of_turn, behind)
        sequenced = self._publishers.sequence(of_turn, due_of)
        self._count(of_turn, sequenced)
        waiting = sequenced.pending.tolist()
        kept = (
            self._kept_on_gap([index for index in waiting if index >= of_turn.waited], messages) if waiting else set()
        )
        self._reorder.add([messages[index] for index in waiting if index not in kept])
        taken = [one for index, one in enumerate(fresh, of_turn.waited) if index not in kept] if kept else fresh
        return Ordered(taken, of_turn, sequenced)

    def _count(self, messages: Messages, sequenced: Sequenced) -> None:
        """Count the payloads that cannot be read, and what the numbers of the others tell."""
        rejected = messages.read.rejected
        for reason in {reason for _, reason in rejected}:
            refused = [index for index, why in rejected if why == reason]
            self._rejections.count_rejected(reason, messages.rows[refused], MESSAGE)
        self._rejections.count_given_up(sequenced.missing)
        self._rejections.count_restarts(sequenced.restarts)
        self._rejections.count_rejected(Reason.DUPLICATE, messages.rows[sequenced.duplicates])

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
        for due in one_per_row(ordered.sequenced.due, ordered.messages.rows):
            sent = read_samples(ordered.messages.read, due)
            batch = Batch(ordered.messages, ordered.sequenced._replace(due=due), sent, [])
            yield from map(self._of_engine, self._on_one_clock(self._screened(batch)))

    def _screened(self, batch: Batch) -> Batch:
        """Return the batch in our units, with values that sensors can have measured."""
        self._engine.convert(batch.samples, batch.messages.rows)
        samples, rejected = screen(batch.samples)
        if not {entry.reason for entry in rejected}.isdisjoint((Reason.IMU_ABSURD, Reason.RANGE_ABSURD)):
            self._note_absurd(batch._replace(rejected=rejected))
        if any(entry.reason == Reason.PRESSURE_NOT_PA for entry in rejected):
            self._note_low(batch)
        return batch._replace(samples=samples, rejected=rejected)

    def _note_absurd(self, batch: Batch) -> None:
        """Tell the check of the sensors about values that no sensor measures: they look like another unit."""
        imu, sizes = absurd_imu(batch.samples.imu)
        ranges = [entry.messages for entry in batch.rejected if entry.reason == Reason.RANGE_ABSURD]
        far = np.concatenate([np.empty(0, np.int64), *ranges])
        self._engine.note_absurd(batch.rows_of(imu), sizes, batch.messages.rows[far])

    def _note_low(self, batch: Batch) -> None:
        """Keep a pressure that is none in Pa for each tag, so that its hint can name the unit that it looks like."""
        low = batch.samples.pressures[batch.samples.pressures["value"] < PRESSURE.limits[0]]
        rows, values = batch.rows_of(low).tolist(), low["value"].tolist()
        self._rows.low_pressures.update(zip(rows, values, strict=True))

    def _on_one_clock(self, batch: Batch) -> Iterator[Batch]:
        """Yield the batch with the estimator's times, behind messages that were doubtful before.

        Rows whose motion went back are restarted.
        """
        arrived, slots = batch.messages.arrived, batch.sequenced.slots
        if not self._host.is_settled:
            newest_ns, due = spans_of(batch).newest, batch.sequenced.due
            timed = due[(slots[due] >= 0) & (newest_ns[due] >= 0)]
            arrived += self._host.settle(slots[timed], newest_ns[timed], arrived[timed])
        times = times_of(batch.samples)
        offsets = self._publishers.time_offsets(batch.messages, batch.sequenced, times, self._host.now_ns())
        arrived += self._host.look(offsets.doubted)
        self._rejections.count_clock_jumps(offsets.jumps)
        for row in batch.messages.rows[offsets.restarts].tolist():
            self._engine.restart(row)
        if len(offsets.doubtful):
            batch = self._doubtful.split(batch, offsets.doubtful)
        yield from starmap(self._in_time, self._doubtful.take_decided())
        yield self._in_time(batch, offsets.messages, offsets.motion)

    def _in_time(self, batch: Batch, offsets: Array, of_motion: Array) -> Batch:
        """Return the batch with the estimator's times, and record times that cannot be."""
        timed, early = in_time(batch, offsets, of_motion)
        for samples in early:
            samples.record(self._rows, batch.messages)
        return timed

    def _of_engine(self, batch: Batch) -> SampleBatch:
        """Return what the engine gets, and record what the batch tells about its tags."""
        spans = spans_of(batch)
        self._note_replays(batch, spans)
        anchored = self._anchored(batch)
        self._note_arrivals(anchored, spans)
        for entry in anchored.rejected:
            self._rejections.count_rejected(entry.reason, batch.messages.rows[entry.messages], entry.kind)
        return engine_columns(anchored)

    def _due_ns(self, fresh: list[Message], now_ns: int) -> int:
        """Return the arrival until which pending messages have waited long enough.

        The window is measured in arrivals, not in time: in a backlog, the missing message may be among the next ones.
        """
        if self._reorder.is_full:
            return now_ns
        return min(now_ns, max(map(ARRIVAL, fresh), default=now_ns)) - self.window_ns

    def _forms(self, payloads: Sequence[bytes], encodings: Sequence[str]) -> Forms:
        """Return the forms of these payloads. A payload that makes the decoder fail is read as an empty one."""
        try:
            return read_forms(payloads, encodings)
        except Exception as error:
            self._rejections.decoder_failed(error)
            return read_forms([_if_readable(*pair) for pair in zip(payloads, encodings, strict=True)], encodings)

    def _note_replays(self, batch: Batch, spans: Spans) -> None:
        """Record how far the newest sample of a replay lies before its arrival.

        Answers subtract it from the age of the poses of a replay. The times of samples do not depend on it.
        """
        due, messages, newest = batch.sequenced.due, batch.messages, spans.newest
        replayed = messages.read.forms["replay"][due] & (newest[due] >= 0)
        self._rows.set_replay_lag(messages.rows[due], np.where(replayed, messages.arrived[due] - newest[due], 0))

    def _note_arrivals(self, batch: Batch, spans: Spans) -> None:
        """Record when the samples of live tags arrived. Its ranges are those to anchors of the site."""
        known, messages = self._rows.arrivals, batch.messages
        self.span_ns = record_arrivals(
            *(known.columns, known.are_conspicuous, messages.read.forms, messages.rows, messages.arrived),
            *(batch.sequenced.due, spans.oldest, spans.newest_of, batch.samples.ranges),
        )

    def _note_unknown_anchors(self, batch: Batch, unknown: Array) -> None:
        """Record these ranges to anchors that their sites do not have. A site without anchors gets the first one."""
        names = batch.samples.anchor_names
        if self._bind_first_anchors(batch, unknown):
            unknown = unknown[self._indices(batch, unknown) < 0]
        messages, first = np.unique(unknown["message"], return_index=True)
        for message, number in zip(messages.tolist(), unknown["anchor"][first].tolist(), strict=True):
            name, tag = names.get(number, str(number)), self._rows.at(int(batch.messages.rows[message]))
            anchors = self._sites[tag.site].tags.unknown_anchors
            anchors.record(tag.row, tag.name, number, name, int(batch.messages.arrived[message]))

    def _bind_first_anchors(self, batch: Batch, ranges: Array) -> bool:
        """Make the first anchor that a tag ranges to the origin of its site. Return whether a site got one.

        ranges: to unknown anchors.
        """
        names = batch.samples.anchor_names
        of_site, first = np.unique(self._rows.sites(batch.rows_of(ranges)), return_index=True)
        numbers = zip(of_site.tolist(), ranges["anchor"][first].tolist(), strict=True)
        bound = [self._sites[site].store.bind_first(names.get(number, str(number))) for site, number in numbers]
        if any(bound):
            self._engine.follow_sites()
        return any(bound)

    def _indices(self, batch: Batch, samples: Array) -> Array:
        """Return the engine's index of the anchor of each sample, -1 if the site of its tag lacks it."""
        return self._engine.anchor_indices(batch.rows_of(samples), samples["anchor"])

    def _anchored(self, batch: Batch) -> Batch:
        """Return the batch with the engine's indices of anchors in `anchor`, without samples of unknown ones."""
        imu, *scalars = batch.samples.columns()
        known = [
            self._of_known_anchors(batch, column, kind) if kind.has_anchor else column
            for kind, column in zip(SCALARS, scalars, strict=True)
        ]
        if all(map(is_, known, scalars)):
            return batch
        return batch._replace(samples=batch.samples.with_columns([imu, *known]))

    def _of_known_anchors(self, batch: Batch, samples: Array, kind: Kind) -> Array:
        if not len(samples):
            return samples
        indices = self._indices(batch, samples)
        if kind.sample is RangeSample and (indices < 0).any():
            self._note_unknown_anchors(batch, samples[indices < 0])
            indices = self._indices(batch, samples)
        unknown = indices < 0
        if unknown.any():
            samples = keep(samples, unknown, Reason.ANCHOR_UNKNOWN, kind.name, batch.rejected)
            indices = indices[~unknown]
        samples["anchor"] = indices
        if kind.sample is BearingSample:
            samples["value"] += np.nan_to_num(self._engine.anchors.places["facing"][indices])
        return samples


def _if_readable(payload: bytes, encoding: str) -> bytes:
    """Return the payload, or an empty one, which is rejected, if the decoder fails on it."""
    try:
        read_forms([payload], [encoding])
    except Exception:
        return b""
    return payload

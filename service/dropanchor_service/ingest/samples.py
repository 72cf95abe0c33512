"""From messages of admitted tags to samples that an engine can take: decode, put in order, screen, map clocks."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import BEARING, HEADING, RANGE, Array, SampleBatch
from dropanchor_service.ingest.buffer import Message
from dropanchor_service.ingest.decode import Decoded, Forms, read_forms, read_samples
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.kernels.values import newest_times, shift_times
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.ingest.rejections import Rejections
from dropanchor_service.ingest.reorder_buffer import ReorderBuffer
from dropanchor_service.ingest.screening import Rejected, keep, screen, within_time
from dropanchor_service.store import SiteStore, TagTable
from dropanchor_service.store.rings import rank_in_row

REORDER_BYTES = 2**26


class SampleReader:
    """Owned by one thread.

    window_ns: so long a message waits for those that its publisher numbered before it.
    """

    def __init__(
        self, site: SiteStore, tags: TagTable, engine: GuardedEngine, rejections: Rejections, window_ns: int
    ) -> None:
        self.window_ns = window_ns
        self.publishers = Publishers()
        self._site = site
        self._tags = tags
        self._engine = engine
        self._rejections = rejections
        self._reorder = ReorderBuffer(REORDER_BYTES)

    @property
    def has_pending(self) -> int:
        """Messages that wait for one before them."""
        return len(self._reorder)

    def batches_of(self, fresh: list[Message], now_ns: int) -> Iterator[SampleBatch]:
        """Those of the fresh messages and of ones held before that are due, at most one of each tag in a batch: what
        becomes of a message does not depend on which others of its tag came in with it."""
        due_ns = self._due_ns(fresh, now_ns)
        messages = [*self._reorder.take_due(fresh, due_ns), *fresh] if self.has_pending else fresh
        if not messages:
            return
        rows, payloads, encodings, arrivals = zip(*messages, strict=True)
        read = self._forms(payloads, encodings)
        of_row, arrived = np.array(rows, np.int32), np.array(arrivals, np.int64)
        for reason in {reason for _, reason in read.rejected}:
            self._rejections.reject(reason, of_row[[index for index, why in read.rejected if why == reason]])
        sequenced = self.publishers.sequence(read.forms, of_row, arrived, due_ns)
        self._rejections.give_up(sequenced.missing)
        self._reorder.add([messages[index] for index in sequenced.pending.tolist()])
        self._rejections.reject(Reason.DUPLICATE, of_row[sequenced.duplicates])
        for due in _one_of_each(sequenced.due, of_row):
            decoded, rejected = screen(read_samples(read, due))
            in_part = replace(sequenced, due=due)
            offsets, jumps = self.publishers.time_offsets(read.forms, in_part, arrived, _times(decoded))
            self._rejections.clocks_jumped(jumps)
            in_time = _in_time(decoded, offsets, rejected)
            self._note_replays(in_time, due, of_row, arrived)
            yield self._batch(in_time, rejected, of_row, arrived)

    def _due_ns(self, fresh: list[Message], now_ns: int) -> int:
        """What arrived until then has waited long enough. The window counts in arrivals: where messages have lain in a
        backlog, one that came soon after those behind the gap may still lie there."""
        if self._reorder.is_full:
            return now_ns
        return min(now_ns, max((message[3] for message in fresh), default=now_ns)) - self.window_ns

    def _forms(self, payloads: Sequence[bytes], encodings: Sequence[str]) -> Forms:
        """A payload that the decoder fails on, which is an error of ours, costs nothing but itself."""
        try:
            return read_forms(payloads, encodings)
        except Exception as error:
            self._rejections.decoder_failed(error)
            return read_forms([_if_readable(*pair) for pair in zip(payloads, encodings, strict=True)], encodings)

    def _note_replays(self, decoded: Decoded, due: Array, of_row: Array, arrived: Array) -> None:
        """How far the newest sample of a replay lies before its arrival: answers count the age of its poses from
        there. No sample's time depends on it."""
        newest = np.full(len(of_row), -1, np.int64)
        for messages, t_ns in _times(decoded) if decoded.forms["replay"][due].any() else ():
            newest_times(t_ns, messages, newest)
        self._tags.set_behind(of_row[due], np.where(newest[due] < 0, 0, arrived[due] - newest[due]))

    def _batch(self, decoded: Decoded, rejected: list[Rejected], of_row: Array, arrived: Array) -> SampleBatch:
        self._bind_first_anchor(decoded)
        self._note_unknown_anchors(decoded, of_row, arrived)
        ranges = self._anchored(decoded.ranges, rejected)
        bearings = self._anchored(decoded.bearings, rejected)
        for entry in rejected:
            self._rejections.reject(entry.reason, of_row[entry.messages])
        decoded.imu["row"] = of_row[decoded.imu["row"]]
        return SampleBatch(
            imu=decoded.imu,
            ranges=_columns(ranges, RANGE, "range", of_row),
            headings=_columns(decoded.headings, HEADING, "heading", of_row),
            bearings=_columns(bearings, BEARING, "bearing", of_row),
        )

    def _bind_first_anchor(self, decoded: Decoded) -> None:
        """A site without anchors takes the first one that is heard as its origin."""
        if self._site.site.anchors or len(decoded.ranges) == 0:
            return
        number = int(decoded.ranges["anchor"][0])
        if self._site.bind_first(decoded.anchor_names.get(number, str(number))):
            self._engine.follow_site()

    def _note_unknown_anchors(self, decoded: Decoded, of_row: Array, arrived: Array) -> None:
        ranges = decoded.ranges[self._engine.anchor_indices(decoded.ranges["anchor"]) < 0]
        messages, first = np.unique(ranges["message"], return_index=True)
        for message, number in zip(messages.tolist(), ranges["anchor"][first].tolist(), strict=True):
            name = decoded.anchor_names.get(number, str(number))
            tag = self._tags.at(int(of_row[message]))
            self._tags.unknown_anchors.note(tag.row, tag.name, number, name, int(arrived[message]))

    def _anchored(self, samples: Array, rejected: list[Rejected]) -> Array:
        """The samples of anchors that the site has, with the engine's index of the anchor in `anchor`."""
        if not len(samples):
            return samples
        indices = self._engine.anchor_indices(samples["anchor"])
        unknown = indices < 0
        kept = keep(samples, samples["message"], unknown, Reason.ANCHOR_UNKNOWN, rejected)
        kept["anchor"] = indices[~unknown]
        return kept


def _if_readable(payload: bytes, encoding: str) -> bytes:
    """Nothing, which is refused by name, in the place of a payload that the decoder fails on."""
    try:
        read_forms([payload], [encoding])
    except Exception:
        return b""
    return payload


def _one_of_each(due: Array, of_row: Array) -> list[Array]:
    """The indices `due` in parts that have no row twice, each row's in their order."""
    ranks = rank_in_row(of_row[due])
    return [due[ranks == rank] for rank in range(int(ranks.max(initial=-1)) + 1)]


def _in_time(decoded: Decoded, offsets: Array, rejected: list[Rejected]) -> Decoded:
    """The samples whose time, moved by the offset of their message, can be one."""
    if not sum(shift_times(t_ns, messages, offsets) for messages, t_ns in _times(decoded)):
        return decoded
    imu, ranges, headings, bearings = (
        keep(samples, messages, ~within_time(samples["t_ns"]), Reason.TIME_OUT_OF_RANGE, rejected)
        for messages, samples in (
            (decoded.imu["row"], decoded.imu),
            *((samples["message"], samples) for samples in (decoded.ranges, decoded.headings, decoded.bearings)),
        )
    )
    return replace(decoded, imu=imu, ranges=ranges, headings=headings, bearings=bearings)


def _times(decoded: Decoded) -> list[tuple[Array, Array]]:
    """The index of the payload and the time of each sample, of every kind."""
    scalars = (decoded.ranges, decoded.headings, decoded.bearings)
    return [(decoded.imu["row"], decoded.imu["t_ns"]), *((column["message"], column["t_ns"]) for column in scalars)]


def _columns(scalars: Array, dtype: "np.dtype[np.void]", value: str, of_row: Array) -> Array:
    """Screened SCALAR as the columns of an engine."""
    batch = np.empty(len(scalars), dtype)
    if not len(scalars):
        return batch
    batch["row"], batch["t_ns"] = of_row[scalars["message"]], scalars["t_ns"]
    batch[value], batch["std"] = scalars["value"], scalars["std"]
    if "anchor" in (dtype.names or ()):
        batch["anchor"] = scalars["anchor"]
    return batch

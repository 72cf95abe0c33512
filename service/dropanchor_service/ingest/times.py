"""Map the times of samples to UTC, and reject those that cannot be."""

from typing import NamedTuple

import numpy as np

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.times import EARLIEST_UTC_NS
from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.batch import Batch, times_of
from dropanchor_service.ingest.kernels.values import shift_times
from dropanchor_service.ingest.messages import Messages
from dropanchor_service.ingest.screening import keep, within_time
from dropanchor_service.store import Rows


class Early(NamedTuple):
    """Samples before the earliest UTC that a tag can send. sent_ns: their times as sent. messages: index of each."""

    messages: Array
    sent_ns: Array

    def record(self, rows: Rows, messages: Messages) -> None:
        """Record a time of each tag."""
        indices, first = np.unique(self.messages, return_index=True)
        for message, sent_ns in zip(indices.tolist(), self.sent_ns[first].tolist(), strict=True):
            row = int(messages.rows[message])
            rows.wrong_times.record(row, rows.at(row).name, sent_ns, int(messages.arrived[message]))


def in_time(batch: Batch, offsets: Array, of_motion: Array) -> tuple[Batch, list[Early]]:
    """Add the offset of its message to the time of each sample, and reject samples whose time then cannot be UTC.

    offsets, of_motion: ns, of each message; empty for none. That of motion holds for IMU samples.
    """
    times = times_of(batch.samples)
    of_kinds = [of_motion, *[offsets] * (len(times) - 1)]
    both = zip(times, of_kinds, strict=True)
    if not sum(shift_times(t_ns, messages, added_ns) for (messages, t_ns), added_ns in both if len(t_ns)):
        return batch, []
    columns, every = [], []
    for kind, column, of_messages in zip(KINDS, batch.samples.columns(), of_kinds, strict=True):
        kept = keep(column, ~within_time(column["t_ns"]), Reason.TIME_OUT_OF_RANGE, kind.name, batch.rejected)
        is_early = kept["t_ns"] < EARLIEST_UTC_NS
        if is_early.any():
            every.append(_early(kept[is_early], of_messages))
        columns.append(keep(kept, is_early, Reason.TIME_NOT_UTC, kind.name, batch.rejected))
    return batch._replace(samples=batch.samples.with_columns(columns)), every


def _early(samples: Array, offsets: Array) -> Early:
    added_ns = offsets[samples["message"]] if len(offsets) else 0
    return Early(samples["message"], samples["t_ns"] - added_ns)

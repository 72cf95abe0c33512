"""Map the times of samples to UTC, and reject those that cannot be."""

from typing import NamedTuple

import numpy as np

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.times import EARLIEST_UTC_NS
from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.decode import Decoded
from dropanchor_service.ingest.kernels.values import shift_times
from dropanchor_service.ingest.publishers import TimeOffsets
from dropanchor_service.ingest.screening import Rejected, keep, within_time
from dropanchor_service.store import Rows


class Early(NamedTuple):
    """Samples before the earliest UTC that a tag can send. sent_ns: their times as sent. messages: index of each."""

    messages: Array
    sent_ns: Array

    def record(self, rows: Rows, of_row: Array, arrived: Array) -> None:
        """Record a time of each tag. of_row, arrived: of all messages."""
        messages, first = np.unique(self.messages, return_index=True)
        for message, sent_ns in zip(messages.tolist(), self.sent_ns[first].tolist(), strict=True):
            row = int(of_row[message])
            rows.wrong_times.record(row, rows.at(row).name, sent_ns, int(arrived[message]))


def times_of(decoded: Decoded) -> list[tuple[Array, Array]]:
    """Return the index of the message and the time of each sample, for every kind."""
    return [(column["message"], column["t_ns"]) for column in decoded.columns()]


def in_time(decoded: Decoded, offsets: TimeOffsets, rejected: list[Rejected]) -> tuple[Decoded, list[Early]]:
    """Add the offset of its message to the time of each sample, and reject samples whose time then cannot be UTC."""
    imu, *scalars = times_of(decoded)
    outside = shift_times(imu[1], imu[0], offsets.motion)
    outside += sum(shift_times(t_ns, messages, offsets.messages) for messages, t_ns in scalars)
    if not outside:
        return decoded, []
    columns, every = [], []
    of_kinds = [offsets.motion, *[offsets.messages] * len(scalars)]
    for kind, column, of_messages in zip(KINDS, decoded.columns(), of_kinds, strict=True):
        kept = keep(column, ~within_time(column["t_ns"]), Reason.TIME_OUT_OF_RANGE, kind.name, rejected)
        is_early = kept["t_ns"] < EARLIEST_UTC_NS
        if is_early.any():
            every.append(_early(kept[is_early], of_messages))
        columns.append(keep(kept, is_early, Reason.TIME_NOT_UTC, kind.name, rejected))
    return decoded.with_columns(columns), every


def _early(samples: Array, offsets: Array) -> Early:
    added_ns = offsets[samples["message"]] if len(offsets) else 0
    return Early(samples["message"], samples["t_ns"] - added_ns)

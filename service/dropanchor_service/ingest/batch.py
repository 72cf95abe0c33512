"""At most one message of each tag on its way to the engine: one value, which each stage takes and returns."""

from typing import NamedTuple

import numpy as np

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.wire import MAX_T_NS
from dropanchor_service.estimation.columns import IMU, Array, SampleBatch
from dropanchor_service.ingest.decode import Decoded
from dropanchor_service.ingest.kernels.values import time_spans
from dropanchor_service.ingest.messages import Messages
from dropanchor_service.ingest.publishers import Sequenced
from dropanchor_service.ingest.screening import Rejected

_DTYPES = [column.dtype for column in SampleBatch().columns()]


class Batch(NamedTuple):
    """messages: all of the turn; an index of a message leads into them. sequenced: `due` are those of this batch.

    samples: of these messages, without those that were rejected so far.
    """

    messages: Messages
    sequenced: Sequenced
    samples: Decoded
    rejected: list[Rejected]

    def rows_of(self, samples: Array) -> Array:
        """Return the row of the tag of each sample."""
        rows: Array = self.messages.rows[samples["message"]]
        return rows


class Spans(NamedTuple):
    """The times of the oldest and the newest sample of each message, and of the newest of each kind; -1 for none."""

    oldest: Array
    newest: Array
    newest_of: Array  # (kinds, messages)


def times_of(decoded: Decoded) -> list[tuple[Array, Array]]:
    """Return the index of the message and the time of each sample, for every kind."""
    return [(column["message"], column["t_ns"]) for column in decoded.columns()]


def spans_of(batch: Batch) -> Spans:
    """Return from when to when the samples of each message of the turn are that are left in the batch."""
    messages = len(batch.messages.rows)
    oldest, newest_of = np.full(messages, MAX_T_NS, np.int64), np.full((len(KINDS), messages), -1, np.int64)
    for (indices, t_ns), newest in zip(times_of(batch.samples), newest_of, strict=True):
        if len(t_ns):
            time_spans(t_ns, indices, oldest, newest)
    return Spans(oldest, newest_of.max(axis=0), newest_of)


def engine_columns(batch: Batch) -> SampleBatch:
    """Return the samples as the engine takes them; those of the IMU in place."""
    imu, *scalars = batch.samples.columns()
    columns = [_column(column, dtype, batch) for column, dtype in zip(scalars, _DTYPES[1:], strict=True)]
    return SampleBatch(_imu_column(imu, batch), *columns)


def _imu_column(samples: Array, batch: Batch) -> Array:
    """Convert IMU_SAMPLE to the IMU column of the engine, in place."""
    imu = samples.view(IMU)
    imu["row"] = batch.rows_of(samples)
    return imu


def _column(scalars: Array, dtype: "np.dtype[np.void]", batch: Batch) -> Array:
    """Convert SCALAR to a column of the engine, with this dtype."""
    column = np.empty(len(scalars), dtype)
    if not len(scalars):
        return column
    names = dtype.names or ()
    column["row"], column["t_ns"] = batch.rows_of(scalars), scalars["t_ns"]
    column[names[-2]], column[names[-1]] = scalars["value"], scalars["std"]
    if "anchor" in names:
        column["anchor"] = scalars["anchor"]
    return column

"""Keep messages whose publisher has set its clock, or sends a backlog, for the half second until that is known."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.batch import Batch
from dropanchor_service.ingest.publishers import Publishers


class _Kept(NamedTuple):
    boot_id: int
    batch: Batch  # of one message


class Doubtful:
    """Owned by one thread."""

    def __init__(self, publishers: Publishers) -> None:
        self._publishers = publishers
        self._kept: dict[int, list[_Kept]] = {}  # by publisher

    def split(self, batch: Batch, doubtful: Array) -> Batch:
        """Keep the messages with the indices `doubtful`. Return the batch without them."""
        for index in doubtful.tolist():
            slot = int(batch.sequenced.slots[index])
            boot_id = int(self._publishers.columns["boot_id"][slot])
            one = _part(batch._replace(rejected=[]), np.array([index]))
            self._kept.setdefault(slot, []).append(_Kept(boot_id, one))
        return _part(batch, np.setdiff1d(batch.sequenced.due, doubtful, assume_unique=True))

    def take_decided(self) -> Iterator[tuple[Batch, Array, Array]]:
        """Yield the kept messages of publishers of which it is known now, with their offsets and those of motion."""
        for slot in [slot for slot in self._kept if not self._publishers.is_doubtful(slot)]:
            publisher, offset_ns = self._publishers.columns[slot], self._publishers.offset_ns(slot)
            for boot_id, batch in self._kept.pop(slot):
                if boot_id == publisher["boot_id"]:  # else another publisher has taken its place
                    offsets = np.full(len(batch.messages.rows), offset_ns)
                    yield batch, offsets, offsets + publisher["motion_shift_ns"]


def _part(batch: Batch, chosen: Array) -> Batch:
    """Return the messages of a batch with the indices `chosen`."""
    columns = [column[np.isin(column["message"], chosen)] for column in batch.samples.columns()]
    return batch._replace(sequenced=batch.sequenced._replace(due=chosen), samples=batch.samples.with_columns(columns))

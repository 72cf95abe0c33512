"""Say until when messages that wait for missing ones have waited long enough, and which of those due go together."""

from collections.abc import Collection

import numpy as np

from dropanchor_schemas.wire import MAX_T_NS
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.messages import Messages
from dropanchor_service.store.rings import rank_in_row

PENDING_OF_TAG = 32  # messages; a tag with more gives up on what is missing, since all tags wait for its next batches


def due_of_each(due_ns: int, window_ns: int, messages: Messages, behind: Collection[int]) -> int | Array:
    """Return the arrival until which messages have waited long enough: `due_ns`, or one for each message.

    behind: rows of which more messages are in the buffer. Their window is measured in their own arrivals. Of a row with
    too many messages that have waited, none waits any longer.
    """
    rows, waited = messages.rows, messages.waited
    if not behind and waited <= PENDING_OF_TAG:
        return due_ns
    newest = np.zeros(int(rows.max(initial=0)) + 1, np.int64)
    np.maximum.at(newest, rows, messages.arrived)
    is_behind = np.isin(rows, np.fromiter(behind, np.int64, len(behind)))
    due: Array = np.where(is_behind, np.minimum(newest[rows] - window_ns, due_ns), due_ns)
    due[np.bincount(rows[:waited], minlength=len(newest))[rows] > PENDING_OF_TAG] = MAX_T_NS
    return due


def one_per_row(due: Array, of_row: Array) -> list[Array]:
    """Split the indices `due` into parts that hold each row at most once, in the order of each row."""
    rows = of_row[due]
    if len(set(rows.tolist())) == len(rows):  # as nearly always
        return [due] if len(due) else []
    ranks = rank_in_row(rows)
    return [due[ranks == rank] for rank in range(int(ranks.max(initial=-1)) + 1)]

"""Read many stored poses at once.

The sqlite3 module gives up the interpreter's lock for every row that it fetches, and must win it back from the engine.
So SQLite joins all poses of a slot into one text, and each slot is one row.
"""

import sqlite3
from collections.abc import Iterator, Sequence

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.records import RECORD, SLOT_NS
from dropanchor_service.history.summaries import POINT, SUMMARY, summary_of_each
from dropanchor_service.store.records import take

_JOINED = np.dtype([("tag", ">u4"), ("t_ns", ">i8"), ("pose", RECORD)])
_SQL = """
SELECT group_concat(printf('%08x%016x', tag, t_ns) || hex(pose), '') FROM slots CROSS JOIN poses USING (slot)
WHERE slots.slot BETWEEN ? AND ? AND t_ns BETWEEN ? AND ? {tags} GROUP BY slots.slot
"""
MAX_NAMED = 100  # tags: beyond, reading all of them is faster than a search for each


def summaries_of_poses(
    connection: sqlite3.Connection, from_ns: int, to_ns: int, tags: Sequence[int] | None
) -> Iterator[Array]:
    """Yield for each slot the SUMMARY of every single pose between the two times, both included.

    tags: their numbers, None for all tags. Raises sqlite3.Error.
    """
    few = tags is not None and len(tags) <= MAX_NAMED
    named = f"AND tag IN ({','.join(map(str, tags))})" if few and tags is not None else ""
    window = (from_ns // SLOT_NS, to_ns // SLOT_NS, from_ns, to_ns)
    for (text,) in connection.execute(_SQL.format(tags=named), window):
        joined = np.frombuffer(bytes.fromhex(text), _JOINED)
        yield _summaries(joined if tags is None or few else take(joined, np.isin(joined["tag"], tags)))


def summaries_in(blobs: Sequence[bytes], tags: Sequence[int] | None) -> Array:
    """Return the SUMMARY records in these blobs, only those of the tags with these numbers."""
    summaries = np.frombuffer(b"".join(blobs), SUMMARY)
    return summaries if tags is None else take(summaries, np.isin(summaries["tag"], tags))


def _summaries(joined: Array) -> Array:
    points, poses = np.zeros(len(joined), POINT), joined["pose"]
    points["t_ns"] = joined["t_ns"]
    for name in ("state", "x", "y", "heading", "speed", "sigma_pos"):
        points[name] = poses[name]
    points["cov_xx"], points["cov_xy"], points["cov_yy"] = poses["cov"][:, 0], poses["cov"][:, 1], poses["cov"][:, 3]
    return summary_of_each(joined["tag"], points)

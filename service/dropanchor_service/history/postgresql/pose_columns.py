"""The columns of the table of poses, as bytes of the binary form of COPY and of arrays, and as POSE and POINT.

Whole columns go through NumPy: nothing is done pose by pose in Python.
Source of both forms: PostgreSQL 15, documentation of COPY, "Binary Format", and `array_send` in its source.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, Frame
from dropanchor_service.history.records import ESTIMATED, StoredPoses
from dropanchor_service.history.summaries import POINT, RELATIVE, SAME_IN_POINT, summary_of_each


class Column(NamedTuple):
    """A column: its name and type in SQL, its NumPy type, its field in POSE, and the place in the covariance."""

    name: str
    sql_type: str
    numpy_type: str
    field: str | None = None
    at: tuple[int, int] | None = None


_KEYS = [
    Column("t_ns", "bigint", ">i8", "t_ns"),
    Column("epoch", "bigint", ">i8"),
    Column("site", "integer", ">i4"),
    Column("tag", "integer", ">i4"),
]
_CONTENT = [
    Column("anchor", "integer", ">i4"),  # -1: none
    *(Column(name, "real", ">f4", field) for name, field in ESTIMATED.items()),
    *(
        Column(f"cov_{'xyh'[row]}{'xyh'[column]}", "real", ">f4", "cov", (row, column))
        for row in range(3)
        for column in range(row, 3)
    ),
    Column("state", "smallint", ">i2", "state"),
    Column("reason", "smallint", ">i2", "reason"),
    Column("z_source", "smallint", ">i2", "z_source"),
    Column("relative", "boolean", "u1"),
]
COLUMNS = [*_KEYS, *_CONTENT]
CONTENT = [column.name for column in _CONTENT]
NAMES = ", ".join(column.name for column in COLUMNS)

_TYPES = {column.name: np.dtype(column.numpy_type) for column in COLUMNS}
_ROW = np.dtype(
    [("fields", ">i2"), *((f"{kind}{name}", t) for name, to in _TYPES.items() for kind, t in (("#", ">i4"), ("", to)))]
)
_HEAD, _END = b"PGCOPY\n\xff\r\n\0" + bytes(8), b"\xff\xff"
_ARRAY_HEAD = 20  # bytes before the first element of an array of one dimension

STORED = [column.name for column in COLUMNS if column.name not in ("site", "tag")]
"""The columns from which `stored_poses` makes poses."""
_OF_POINTS = {column.field: column.name for column in COLUMNS if column.field in SAME_IN_POINT}
POINTS = ["tag", "relative", *_OF_POINTS.values(), "cov_xx", "cov_xy", "cov_yy"]
"""The columns from which `summaries` makes summaries."""


def rows_of(poses: Array, site: int, tags: Array, anchors: Array, epoch: int) -> Array:
    """Return a record per POSE as COPY takes it. tags, anchors: the number of the tag and anchor of each."""
    rows = np.zeros(len(poses), _ROW)
    rows["fields"] = len(COLUMNS)
    for name, numpy_type in _TYPES.items():
        rows[f"#{name}"] = numpy_type.itemsize
    rows["site"], rows["tag"], rows["anchor"], rows["epoch"] = site, tags, anchors, epoch
    rows["relative"] = poses["frame"] == Frame.RELATIVE
    for column in COLUMNS:
        if column.field is not None:
            rows[column.name] = _field(poses, column.field, column.at)
    return rows


def copied(rows: Array) -> bytes:
    """Return the rows as a file of COPY in its binary form."""
    return _HEAD + rows.tobytes() + _END


def arrays(names: Sequence[str]) -> str:
    """Return the SQL of these columns, each as the bytes of one array."""
    return ", ".join(f"array_send(array_agg({name}))" for name in names)


def stored_poses(row: Sequence[bytes], anchor_names: dict[int, str]) -> StoredPoses:
    """Return the poses in these arrays of STORED."""
    columns = _columns(STORED, row)
    poses = np.zeros(len(columns["t_ns"]), POSE)
    poses["row"], poses["anchor"] = -1, -1
    poses["frame"] = np.where(columns["relative"], Frame.RELATIVE, Frame.SITE)
    for column in COLUMNS:
        if column.field is not None:
            _field(poses, column.field, column.at)[:] = columns[column.name]
        if column.at is not None:
            _field(poses, "cov", column.at[::-1])[:] = columns[column.name]
    anchors = [anchor_names.get(anchor) for anchor in columns["anchor"].tolist()]
    return StoredPoses(poses, anchors, columns["epoch"].astype(np.int64))


def summaries(row: Sequence[bytes]) -> Array:
    """Return the SUMMARY of each single pose in these arrays of POINTS."""
    columns = _columns(POINTS, row)
    points = np.zeros(len(columns["t_ns"]), POINT)
    for field, name in _OF_POINTS.items():
        points[field] = columns[name]
    for name in ("cov_xx", "cov_xy", "cov_yy"):
        points[name] = columns[name]
    points["state"] |= np.where(columns["relative"], RELATIVE, 0).astype(np.uint8)
    return summary_of_each(columns["tag"], points)


def _field(poses: Array, name: str, at: tuple[int, int] | None) -> Array:
    """Return a view of a field of POSE, or of one place of the covariance."""
    view: Array = poses[name] if at is None else poses[name][:, at[0], at[1]]
    return view


def _columns(names: Sequence[str], row: Sequence[bytes]) -> dict[str, Array]:
    """Return the values in the bytes of each array: a length before each value."""
    return {
        name: np.frombuffer(data, np.dtype([("length", ">i4"), ("value", _TYPES[name])]), offset=_ARRAY_HEAD)["value"]
        for name, data in zip(names, row, strict=True)
    }

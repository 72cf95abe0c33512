"""Many poses as the JSON of the contract, written column by column: no object per tag.

The bytes are those that `to_json` writes of the same poses as dictionaries.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import orjson

from dropanchor_service.estimation.batch import Array
from dropanchor_service.store.columns import PoseColumns

CHUNK = 1000  # poses

_NULL = b"null"
_SCALARS = {"x": "x", "y": "y", "heading_rad": "heading", "speed_mps": "speed", "yaw_rate_radps": "yaw_rate"}
_QUALITY = {"p_mode": "p_mode", "sigma_pos_m": "sigma_pos", "sigma_obs_m": "sigma_obs", "range_m": "range"}

Fields = dict[str, Sequence[bytes]]


def poses_json(columns: PoseColumns, hypotheses: Sequence[bytes]) -> bytes:
    """`Pose` of each, with commas between. hypotheses: JSON of each."""
    fields: Fields = {
        "tag": _texts(columns.tags),
        "t_ns": _numbers(columns.poses["t_ns"]),
        "age_s": _numbers(columns.age_s),
        "state": _repeated(columns.states),
        "reason": _repeated(columns.reasons),
        "hint": _repeated(columns.hints),
        **{name: _numbers(columns.poses[field]) for name, field in _SCALARS.items()},
        "covariance": _matrices(columns.poses["cov"]),
        "ellipse_95": _ellipses(columns.semi_major_m, columns.semi_minor_m, columns.angle_rad),
        **{name: _numbers(columns.poses[field]) for name, field in _QUALITY.items()},
        "anchor": _repeated(columns.anchors),
        "hypotheses": hypotheses,
        "lat": [_NULL] * len(hypotheses) if columns.lat is None else _numbers(columns.lat),
        "lon": [_NULL] * len(hypotheses) if columns.lon is None else _numbers(columns.lon),
        "online": _repeated(columns.online),
    }
    return _objects(fields, len(hypotheses))


def list_json(t_ns: int, poses: Array, chunk_json: Callable[[Array], bytes]) -> Iterator[bytes]:
    """`PoseList` of the POSE rows, in chunks."""
    yield b'{"t_ns":%d,"poses":[' % t_ns
    for begin in range(0, len(poses), CHUNK):
        yield (b"," if begin else b"") + chunk_json(poses[begin : begin + CHUNK])
    yield b"]}"


def _objects(fields: Fields, count: int) -> bytes:
    """{"a":1,"b":2},{"a":3,"b":4} of {"a": [1, 3], "b": [2, 4]}."""
    width = 2 * len(fields)
    parts: list[bytes] = [b""] * (width * count)
    for place, (name, values) in enumerate(fields.items()):
        opening = b',"' if place else b'},{"'
        parts[2 * place :: width] = [opening + name.encode() + b'":'] * count
        parts[2 * place + 1 :: width] = values
    return b"".join(parts)[2:] + b"}" if count else b""


def _numbers(values: Array) -> list[bytes]:
    """Shortest form that reads back equal; NaN as null."""
    return _dumped(np.ascontiguousarray(values))[1:-1].split(b",")


def _texts(values: list[str]) -> list[bytes]:
    """Inside a string a quote is escaped, so only between two of them can `","` stand."""
    return [b'"%b"' % text for text in orjson.dumps(values)[2:-2].split(b'","')]


def _repeated(values: Sequence[str | bool | None]) -> list[bytes]:
    """Of which there are few."""
    known = {value: orjson.dumps(value) for value in set(values)}
    return [known[value] for value in values]


def _matrices(values: Array) -> list[bytes]:
    known: list[bool] = np.logical_and.reduce(np.isfinite(values), axis=(1, 2)).tolist()
    texts = _dumped(np.ascontiguousarray(values))[3:-3].split(b"]],[[")
    return [b"[[%b]]" % text if finite else _NULL for text, finite in zip(texts, known, strict=True)]


def _ellipses(major: Array, minor: Array, angle: Array) -> list[bytes]:
    columns = (_numbers(column) for column in (major, minor, angle))
    return [
        b'{"semi_major_m":%b,"semi_minor_m":%b,"angle_rad":%b}' % axes if axes[0] != _NULL else _NULL
        for axes in zip(*columns, strict=True)
    ]


def _dumped(values: Any) -> bytes:
    return orjson.dumps(values, option=orjson.OPT_SERIALIZE_NUMPY)

"""`PoseList` written straight from columns: byte for byte what `to_json` makes of the dictionaries, in a fraction of
the time. At ten thousand tags the dictionaries, their lists and the collector that walks over them cost most of it."""

from collections.abc import Iterable, Sequence

import numpy as np
import orjson

from dropanchor_service.estimation.batch import Array
from dropanchor_service.store.columns import PoseColumns

Texts = list[bytes]
"""One piece of JSON per tag."""

_END = b"\x00"  # between the texts of a column: JSON never holds it unescaped


def pose_list_text(columns: PoseColumns, hypotheses: Texts, now_ns: int) -> bytes:
    """hypotheses: the JSON array of each pose's hypotheses."""
    head = b'{"t_ns":%d,"poses":[' % now_ns
    count = len(columns.poses)
    if count == 0:
        return head + b"]}"
    pieces = list(_columns(columns, hypotheses))
    together = [b""] * (count * len(pieces))
    for index, texts in enumerate(pieces):
        together[index :: len(pieces)] = texts
    together[0] = together[0].removeprefix(b",")
    return b"".join([head, *together, b"]}"])


def _columns(columns: PoseColumns, hypotheses: Texts) -> Iterable[Texts]:
    """What stands in each pose, in order; joined row by row it is the list."""
    poses = columns.poses
    yield _strings(b',{"tag":', columns.tags)
    yield _numbers(b',"t_ns":', poses["t_ns"])
    yield _numbers(b',"age_s":', columns.age_s)
    yield _strings(b',"state":', columns.states)
    yield _strings(b',"reason":', columns.reasons)
    yield _strings(b',"hint":', columns.hints)
    for name, field in _BEFORE_COVARIANCE.items():
        yield _numbers(b',"%b":' % name, poses[field])
    yield _covariances(poses["cov"])
    yield from _ellipses(columns)
    for name, field in _BEHIND_COVARIANCE.items():
        yield _numbers(b',"%b":' % name, poses[field])
    yield _strings(b',"anchor":', columns.anchors)
    yield [b',"hypotheses":' + text for text in hypotheses]
    yield from (_degrees(b',"lat":', columns.lat, len(poses)), _degrees(b',"lon":', columns.lon, len(poses)))
    yield [b',"online":true}' if online else b',"online":false}' for online in columns.online]


_BEFORE_COVARIANCE = {
    b"x": "x",
    b"y": "y",
    b"heading_rad": "heading",
    b"speed_mps": "speed",
    b"yaw_rate_radps": "yaw_rate",
}
_BEHIND_COVARIANCE = {
    b"p_mode": "p_mode",
    b"sigma_pos_m": "sigma_pos",
    b"sigma_obs_m": "sigma_obs",
    b"range_m": "range",
}


def _numbers(name: bytes, values: Array) -> Texts:
    """`name` and the number, NaN as null."""
    text = orjson.dumps(np.ascontiguousarray(values), option=orjson.OPT_SERIALIZE_NUMPY)
    return (name + text[1:-1].replace(b",", _END + name)).split(_END)


def _strings(name: bytes, values: Sequence[str | None]) -> Texts:
    known = {value: name + orjson.dumps(value) for value in set(values)}
    return [known[value] for value in values]


def _degrees(name: bytes, values: Array | None, count: int) -> Texts:
    return [name + b"null"] * count if values is None else _numbers(name, values)


def _covariances(cov: Array) -> Texts:
    name = b',"covariance":'
    text = orjson.dumps(np.ascontiguousarray(cov), option=orjson.OPT_SERIALIZE_NUMPY)
    texts = (name + text[1:-1].replace(b"]],[[", b"]]" + _END + name + b"[[")).split(_END)
    for index in np.flatnonzero(~np.isfinite(cov).all(axis=(1, 2))).tolist():
        texts[index] = name + b"null"
    return texts


def _ellipses(columns: PoseColumns) -> tuple[Texts, Texts, Texts]:
    major = _numbers(b',"ellipse_95":{"semi_major_m":', columns.semi_major_m)
    minor = _numbers(b',"semi_minor_m":', columns.semi_minor_m)
    angle = [text + b"}" for text in _numbers(b',"angle_rad":', columns.angle_rad)]
    for index in np.flatnonzero(np.isnan(columns.semi_major_m)).tolist():
        major[index], minor[index], angle[index] = b',"ellipse_95":null', b"", b""
    return major, minor, angle

"""Payloads of many messages to columns at once: no Python loop per sample for packed payloads.

Agrees exactly with `dropanchor_schemas.wire.decode_packed` and `decode_json`, which define the contract; values are
not judged here, only the form.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import DTypeLike

from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    FLAG_BOOT_CLOCK,
    MAX_PAYLOAD_BYTES,
    MAX_T_NS,
    VERSION,
    BearingSample,
    Frame,
    HeadingSample,
    RangeSample,
    Reason,
    Rejection,
    read_header,
)
from dropanchor_service.estimation.batch import IMU, Array

HEADER = np.dtype(
    [
        *(("version", "u1"), ("flags", "u1"), ("imu", "<u2"), ("range", "<u2"), ("heading", "<u2")),
        *(("sequence", "<u4"), ("boot_id", "<u4"), ("t0_ns", "<i8"), ("bearing", "<u2")),
        *(("zero16", "<u2"), ("zero32", "<u4")),
    ]
)
_F4_3 = ("<f4", 3)
_PACKED_IMU = np.dtype([("dt_us", "<u4"), ("acc", *_F4_3), ("gyro", *_F4_3), ("mag", *_F4_3)])
_PACKED_ANCHORED = np.dtype([("dt_us", "<u4"), ("anchor", "<u4"), ("value", "<f4"), ("std", "<f4")])
_PACKED_HEADING = np.dtype([("dt_us", "<u4"), ("value", "<f4"), ("std", "<f4")])

FORM = np.dtype(
    [
        ("accepted", "?"),
        ("boot_clock", "?"),
        ("numbered", "?"),  # has a sequence and a boot id
        ("sequence", "u4"),
        ("boot_id", "u4"),
    ]
)
# A range, heading or bearing; `message` is the index of its payload, `anchor` the number on the wire.
SCALAR = np.dtype([("message", "i4"), ("t_ns", "i8"), ("anchor", "u4"), ("value", "f8"), ("std", "f8")])

_NO_FIELD = (np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class Decoded:
    """Columns of a list of payloads; samples are in the order of their payloads.

    forms: FORM, one per payload.
    rejected: index of the payload and why, for each that has no samples.
    imu: IMU, whose `row` is the index of the payload. ranges, headings, bearings: SCALAR.
    anchor_names: number → text of the anchors that were named by text.
    """

    forms: Array
    rejected: list[tuple[int, Reason]] = field(default_factory=list)
    imu: Array = field(default_factory=lambda: np.empty(0, IMU))
    ranges: Array = field(default_factory=lambda: np.empty(0, SCALAR))
    headings: Array = field(default_factory=lambda: np.empty(0, SCALAR))
    bearings: Array = field(default_factory=lambda: np.empty(0, SCALAR))
    anchor_names: dict[int, str] = field(default_factory=dict)


def decode(payloads: Sequence[bytes], encodings: Sequence[str]) -> Decoded:
    """The columns of these payloads, each in its Zenoh encoding."""
    packed: list[int] = []
    json: list[int] = []
    rejected: list[tuple[int, Reason]] = []
    for index, encoding in enumerate(encodings):
        kind = encoding.partition(";")[0]
        if kind == ENCODING_PACKED:
            packed.append(index)
        elif kind == ENCODING_JSON:
            json.append(index)
        else:
            rejected.append((index, Reason.ENCODING_UNKNOWN))
    with np.errstate(invalid="ignore"):  # a signalling NaN is a value like any other; screening judges it
        parts = [_decode_packed(payloads, packed), _decode_json(payloads, json)]
    return _merged([part for part in parts if part is not None], len(payloads), rejected)


def _decode_packed(payloads: Sequence[bytes], indices: list[int]) -> Decoded | None:
    """Only what has the right form throughout is read; the rest is put to `read_header`, which names the reason."""
    if not indices:
        return None
    forms = np.zeros(len(payloads), FORM)
    whole = [index for index in indices if HEADER.itemsize <= len(payloads[index]) <= MAX_PAYLOAD_BYTES]
    blob = b"".join([payloads[index] for index in whole])
    sizes = np.array([len(payloads[index]) for index in whole], np.int64)
    starts = np.cumsum(sizes) - sizes
    headers = _records(blob, HEADER, starts)
    good = _has_right_form(headers, sizes)
    messages, headers, starts = np.array(whole, np.int64)[good], headers[good], starts[good]
    forms["accepted"][messages] = True
    forms["numbered"][messages] = headers["boot_id"] != 0
    forms["boot_clock"][messages] = headers["flags"] & FLAG_BOOT_CLOCK != 0
    forms["sequence"][messages], forms["boot_id"][messages] = headers["sequence"], headers["boot_id"]
    refused = [index for index in indices if not forms["accepted"][index]]
    rejected = [(index, read_header(payloads[index])) for index in refused]
    block = _Blocks(blob, messages, headers, starts + HEADER.itemsize)
    return Decoded(
        forms,
        [(index, why.reason) for index, why in rejected if isinstance(why, Rejection)],
        imu=block.imu(),
        ranges=block.scalars("range", _PACKED_ANCHORED),
        headings=block.scalars("heading", _PACKED_HEADING),
        bearings=block.scalars("bearing", _PACKED_ANCHORED),
    )


def _has_right_form(headers: Array, sizes: Array) -> Array:
    """The checks of `read_header`."""
    counts = [headers[name].astype(np.int64) for name in ("imu", "range", "heading", "bearing")]
    widths = (_PACKED_IMU, _PACKED_ANCHORED, _PACKED_HEADING, _PACKED_ANCHORED)
    needed = HEADER.itemsize + sum(count * width.itemsize for count, width in zip(counts, widths, strict=True))
    right: Array = (
        (headers["version"] == VERSION)
        & (headers["flags"] & ~np.uint8(FLAG_BOOT_CLOCK) == 0)
        & (headers["zero16"] == 0)
        & (headers["zero32"] == 0)
        & (sizes == needed)
        & (sizes > HEADER.itemsize)
        & (headers["t0_ns"] >= 0)
        & (headers["t0_ns"] < MAX_T_NS)
    )
    return right


class _Blocks:
    """Reads the blocks of one kind after another from payloads that lie end to end in `blob`."""

    def __init__(self, blob: bytes, messages: Array, headers: Array, starts: Array) -> None:
        self._blob = blob
        self._messages = messages
        self._headers = headers
        self._starts = starts

    def imu(self) -> Array:
        records, which = self._next("imu", _PACKED_IMU)
        samples = np.empty(len(records), IMU)
        samples["row"] = self._messages[which]
        samples["t_ns"] = self._times(records, which)
        for name in ("acc", "gyro", "mag"):
            samples[name] = records[name]
        return samples

    def scalars(self, kind: str, dtype: np.dtype[np.void]) -> Array:
        records, which = self._next(kind, dtype)
        samples = np.zeros(len(records), SCALAR)
        samples["message"] = self._messages[which]
        samples["t_ns"] = self._times(records, which)
        if "anchor" in (dtype.names or ()):
            samples["anchor"] = records["anchor"]
        samples["value"], samples["std"] = records["value"], records["std"]
        return samples

    def _next(self, kind: str, dtype: np.dtype[np.void]) -> tuple[Array, Array]:
        """The records of this kind, and the header that each belongs to."""
        counts = self._headers[kind].astype(np.int64)
        which = np.repeat(np.arange(len(counts)), counts)
        within = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
        records = _records(self._blob, dtype, self._starts[which] + dtype.itemsize * within)
        self._starts = self._starts + dtype.itemsize * counts
        return records, which

    def _times(self, records: Array, which: Array) -> Array:
        times: Array = self._headers["t0_ns"][which] + 1000 * records["dt_us"].astype(np.int64)
        return times


def _records(blob: bytes, dtype: np.dtype[np.void], starts: Array) -> Array:
    """A copy of the record that begins at each of `starts`: a view with one record per byte, indexed."""
    if len(starts) == 0:
        return np.empty(0, dtype)
    every = np.ndarray((len(blob) - dtype.itemsize + 1,), dtype, blob, strides=(1,))
    return every[starts]


def _decode_json(payloads: Sequence[bytes], indices: list[int]) -> Decoded | None:
    if not indices:
        return None
    forms = np.zeros(len(payloads), FORM)
    rejected: list[tuple[int, Reason]] = []
    frames: list[tuple[int, Frame]] = []
    for index in indices:
        frame = decode_json(payloads[index])
        if isinstance(frame, Rejection):
            rejected.append((index, frame.reason))
            continue
        frames.append((index, frame))
        numbered = frame.sequence is not None and bool(frame.boot_id)
        forms[index] = (True, frame.boot_clock, numbered, frame.sequence or 0, frame.boot_id or 0)
    return Decoded(
        forms,
        rejected,
        imu=_column(IMU, [(i, s.t_ns, s.acc, s.gyro, s.mag or _NO_FIELD) for i, f in frames for s in f.imu]),
        ranges=_column(SCALAR, [_scalar(i, s) for i, f in frames for s in f.ranges]),
        headings=_column(SCALAR, [_scalar(i, s) for i, f in frames for s in f.headings]),
        bearings=_column(SCALAR, [_scalar(i, s) for i, f in frames for s in f.bearings]),
        anchor_names={number: name for _, f in frames for number, name in f.anchor_names.items()},
    )


def _scalar(index: int, sample: RangeSample | HeadingSample | BearingSample) -> tuple[int, int, int, float, float]:
    match sample:
        case HeadingSample(t_ns, value, std):
            return index, t_ns, 0, value, std
        case RangeSample(t_ns, anchor, value, std) | BearingSample(t_ns, anchor, value, std):
            return index, t_ns, anchor, value, std


def _column(dtype: DTypeLike, samples: list[tuple[object, ...]]) -> Array:
    return np.array(samples, dtype) if samples else np.empty(0, dtype)


def _merged(parts: list[Decoded], payloads: int, rejected: list[tuple[int, Reason]]) -> Decoded:
    forms = np.zeros(payloads, FORM)
    for part in parts:
        forms[part.forms["accepted"]] = part.forms[part.forms["accepted"]]
    names: dict[int, str] = {}
    for part in parts:
        names |= part.anchor_names
    return Decoded(
        forms,
        sorted([*rejected, *(entry for part in parts for entry in part.rejected)]),
        imu=_in_order([part.imu for part in parts], IMU, "row"),
        ranges=_in_order([part.ranges for part in parts], SCALAR, "message"),
        headings=_in_order([part.headings for part in parts], SCALAR, "message"),
        bearings=_in_order([part.bearings for part in parts], SCALAR, "message"),
        anchor_names=names,
    )


def _in_order(columns: list[Array], dtype: DTypeLike, message: str) -> Array:
    filled = [column for column in columns if len(column)]
    if len(filled) < 2:
        return filled[0] if filled else np.empty(0, dtype)
    together = np.concatenate(filled)
    return together[np.argsort(together[message], kind="stable")]

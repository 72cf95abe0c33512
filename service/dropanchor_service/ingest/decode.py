"""Decode the payloads of many messages to columns at once, without a Python step per sample for packed payloads.

The results equal those of `dropanchor_schemas.wire.decode_packed` and `decode_json`, which define the contract. Only
the form is checked here, not the values.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    HEADER,
    MAX_PAYLOAD_BYTES,
    BearingSample,
    Frame,
    HeadingSample,
    RangeSample,
    Reason,
    Rejection,
    read_header,
)
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.kernels import packed
from dropanchor_service.ingest.kernels.packed import FORM

# `message` is the index of the payload. An IMU_SAMPLE has the memory layout of the engine's IMU, to be viewed as it.
IMU_SAMPLE = np.dtype([("message", "i4"), ("t_ns", "i8"), ("acc", "f8", 3), ("gyro", "f8", 3), ("mag", "f8", 3)])
# A range, heading or bearing; `anchor` is the number on the wire.
SCALAR = np.dtype([("message", "i4"), ("t_ns", "i8"), ("anchor", "u4"), ("value", "f8"), ("std", "f8")])

_NO_FIELD = (np.nan, np.nan, np.nan)
_WORD = 4


@dataclass(frozen=True)
class Forms:
    """The form of each payload of a list, and what is needed to read their samples.

    forms: FORM, one per payload. rejected: index and reason of each payload that is not used.
    blob: the packed payloads end to end. frames: the decoded JSON payloads, by index.
    """

    forms: Array
    rejected: list[tuple[int, Reason]]
    blob: bytes
    frames: dict[int, Frame]


@dataclass(frozen=True)
class Decoded:
    """Columns of a list of payloads; samples are in the order of their payloads.

    forms: FORM, one per payload.
    rejected: index and reason of each payload that is not used.
    imu: IMU_SAMPLE. ranges, headings, bearings: SCALAR.
    anchor_names: name by number, of the anchors that are named by text.
    """

    forms: Array
    rejected: list[tuple[int, Reason]] = field(default_factory=list)
    imu: Array = field(default_factory=lambda: np.empty(0, IMU_SAMPLE))
    ranges: Array = field(default_factory=lambda: np.empty(0, SCALAR))
    headings: Array = field(default_factory=lambda: np.empty(0, SCALAR))
    bearings: Array = field(default_factory=lambda: np.empty(0, SCALAR))
    anchor_names: dict[int, str] = field(default_factory=dict)


def decode(payloads: Sequence[bytes], encodings: Sequence[str]) -> Decoded:
    """Return the columns of these payloads, each in its Zenoh encoding."""
    forms = read_forms(payloads, encodings)
    return read_samples(forms, np.flatnonzero(forms.forms["accepted"]))


def read_forms(payloads: Sequence[bytes], encodings: Sequence[str]) -> Forms:
    """Return the forms of these payloads, each in its Zenoh encoding."""
    forms = np.zeros(len(payloads), FORM)
    forms["start"] = -1
    if encodings.count(ENCODING_PACKED) == len(encodings):
        blob, rejected = _packed_forms(payloads, range(len(payloads)), forms)
        return Forms(forms, rejected, blob, {})
    kinds = [encoding.partition(";")[0] for encoding in encodings]
    blob, rejected = _packed_forms(payloads, [i for i, kind in enumerate(kinds) if kind == ENCODING_PACKED], forms)
    frames, refused = _json_forms(payloads, [i for i, kind in enumerate(kinds) if kind == ENCODING_JSON], forms)
    unknown = [
        (i, Reason.ENCODING_UNKNOWN) for i, kind in enumerate(kinds) if kind not in (ENCODING_PACKED, ENCODING_JSON)
    ]
    return Forms(forms, sorted([*rejected, *refused, *unknown]), blob, frames)


def read_samples(read: Forms, chosen: Array) -> Decoded:
    """Return the columns of the payloads with the indices `chosen`, which were accepted, in that order."""
    words, floats = np.frombuffer(read.blob, "<u4"), np.frombuffer(read.blob, "<f4")
    counts = read.forms["counts"][chosen].sum(axis=0)
    imu = np.empty(counts[0], IMU_SAMPLE)
    ranges, headings, bearings = (np.empty(count, SCALAR) for count in counts[1:])
    packed.read_samples(words, floats, read.forms, chosen, imu, ranges, headings, bearings)
    decoded = Decoded(read.forms, read.rejected, imu, ranges, headings, bearings)
    return _with_json(decoded, read.frames, chosen) if read.frames else decoded


def _packed_forms(
    payloads: Sequence[bytes], indices: Sequence[int], forms: Array
) -> tuple[bytes, list[tuple[int, Reason]]]:
    """Fill the forms of the payloads with these indices.

    Returns the payloads end to end, and index and reason of those that are rejected, which `read_header` names.
    """
    chosen = payloads if len(indices) == len(payloads) else [payloads[index] for index in indices]
    sizes = np.fromiter(map(len, chosen), np.int64, len(chosen))
    whole = (sizes >= HEADER.size) & (sizes <= MAX_PAYLOAD_BYTES) & (sizes % _WORD == 0)
    if whole.all():
        where = np.asarray(indices, np.int64)
        blob = b"".join(chosen)
    else:
        where = np.asarray(indices, np.int64)[whole]
        sizes = sizes[whole]
        blob = b"".join([payloads[index] for index in where.tolist()])
    ends = np.cumsum(sizes) // _WORD
    accepted = packed.read_forms(np.frombuffer(blob, "<u4"), ends - sizes // _WORD, sizes // _WORD, where, forms)
    refused = [] if accepted == len(indices) else [i for i in indices if not forms["accepted"][i]]
    reasons = [(index, read_header(payloads[index])) for index in refused]
    return blob, [(index, why.reason) for index, why in reasons if isinstance(why, Rejection)]


def _json_forms(
    payloads: Sequence[bytes], indices: Sequence[int], forms: Array
) -> tuple[dict[int, Frame], list[tuple[int, Reason]]]:
    frames: dict[int, Frame] = {}
    rejected: list[tuple[int, Reason]] = []
    for index in indices:
        frame = decode_json(payloads[index])
        if isinstance(frame, Rejection):
            rejected.append((index, frame.reason))
            continue
        frames[index] = frame
        form = forms[index]
        form["accepted"], form["boot_clock"], form["replay"] = True, frame.boot_clock, frame.replay
        form["numbered"] = frame.sequence is not None and bool(frame.boot_id)
        form["sequence"], form["boot_id"] = frame.sequence or 0, frame.boot_id or 0
    return frames, rejected


def _with_json(decoded: Decoded, all_frames: dict[int, Frame], chosen: Array) -> Decoded:
    """Merge the samples of JSON payloads into those of packed ones, in the order of `chosen`."""
    frames = [(index, all_frames[index]) for index in chosen.tolist() if index in all_frames]
    place = np.zeros(len(decoded.forms), np.int64)
    place[chosen] = np.arange(len(chosen))
    imu = [(i, s.t_ns, s.acc, s.gyro, s.mag or _NO_FIELD) for i, f in frames for s in f.imu]
    return Decoded(
        decoded.forms,
        decoded.rejected,
        imu=_merged(decoded.imu, imu, place),
        ranges=_merged(decoded.ranges, [_scalar(i, s) for i, f in frames for s in f.ranges], place),
        headings=_merged(decoded.headings, [_scalar(i, s) for i, f in frames for s in f.headings], place),
        bearings=_merged(decoded.bearings, [_scalar(i, s) for i, f in frames for s in f.bearings], place),
        anchor_names={number: name for _, f in frames for number, name in f.anchor_names.items()},
    )


def _scalar(index: int, sample: RangeSample | HeadingSample | BearingSample) -> tuple[int, int, int, float, float]:
    match sample:
        case HeadingSample(t_ns, value, std):
            return index, t_ns, 0, value, std
        case RangeSample(t_ns, anchor, value, std) | BearingSample(t_ns, anchor, value, std):
            return index, t_ns, anchor, value, std


def _merged(column: Array, samples: Sequence[tuple[object, ...]], place: Array) -> Array:
    if not samples:
        return column
    both = np.concatenate([column, np.array(samples, column.dtype)])
    return both[np.argsort(place[both["message"]], kind="stable")]

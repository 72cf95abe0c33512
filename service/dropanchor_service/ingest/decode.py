"""Decode the payloads of many messages to columns at once, without a Python step per sample for packed payloads.

The results equal those of `dropanchor_schemas.wire.decode_packed` and `decode_json`, which define the contract. Only
the form is checked here, not the values.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from dropanchor_schemas.kinds import IMU, KINDS, Frame, Kind
from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    HEADER,
    MAX_PAYLOAD_BYTES,
    Reason,
    Rejection,
    read_header,
)
from dropanchor_service.estimation.columns import Array, SampleBatch
from dropanchor_service.ingest.kernels import packed
from dropanchor_service.ingest.kernels.packed import FORM

# `message` is the index of the payload. An IMU_SAMPLE has the memory layout of the engine's IMU, to be viewed as it.
IMU_SAMPLE = np.dtype([("message", "i4"), ("t_ns", "i8"), ("acc", "f8", 3), ("gyro", "f8", 3), ("mag", "f8", 3)])
# A sample of one of `SCALARS`; `anchor` is the number on the wire, `std` its second number.
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
    rejected: list[tuple[int, Reason]] = field(default_factory=list)
    blob: bytes = b""
    frames: dict[int, Frame] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Decoded(SampleBatch):
    """Columns of a list of payloads: IMU_SAMPLE, and SCALAR of each other kind, in the order of their payloads.

    forms: FORM, one per payload.
    rejected: index and reason of each payload that is not used.
    anchor_names: name by number, of the anchors that are named by text.
    """

    forms: Array
    rejected: list[tuple[int, Reason]] = field(default_factory=list)
    anchor_names: dict[int, str] = field(default_factory=dict)

    def with_columns(self, columns: Sequence[Array]) -> "Decoded":
        """Return the same with other columns, one for each of `KINDS`."""
        return Decoded(*columns, forms=self.forms, rejected=self.rejected, anchor_names=self.anchor_names)


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
    imu, scalars = np.empty(counts[0], IMU_SAMPLE), np.empty(counts[1:].sum(), SCALAR)
    ends = np.cumsum(counts[1:])
    packed.read_samples(words, floats, read.forms, chosen, imu, scalars, ends - counts[1:])
    columns = [scalars[begin:end] for begin, end in pairwise([0, *ends.tolist()])]
    decoded = Decoded(imu, *columns, forms=read.forms, rejected=read.rejected)
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
        form["kinds"] = sum(1 << kind for kind, count in enumerate(frame.counts()) if count)
    return frames, rejected


def _with_json(decoded: Decoded, all_frames: dict[int, Frame], chosen: Array) -> Decoded:
    """Merge the samples of JSON payloads into those of packed ones, in the order of `chosen`."""
    frames = [(index, all_frames[index]) for index in chosen.tolist() if index in all_frames]
    place = np.zeros(len(decoded.forms), np.int64)
    place[chosen] = np.arange(len(chosen))
    columns = [
        _merged(column, [_values(kind, i, s) for i, f in frames for s in getattr(f, kind.field)], place)
        for kind, column in zip(KINDS, decoded.columns(), strict=True)
    ]
    names = {number: name for _, f in frames for number, name in f.anchor_names.items()}
    return Decoded(*columns, forms=decoded.forms, rejected=decoded.rejected, anchor_names=names)


def _values(kind: Kind, index: int, sample: Any) -> tuple[Any, ...]:
    """Return the values of IMU_SAMPLE or SCALAR."""
    if kind is IMU:
        return index, sample.t_ns, sample.acc, sample.gyro, sample.mag or _NO_FIELD
    return index, sample.t_ns, sample.anchor if kind.has_anchor else 0, *sample[-2:]


def _merged(column: Array, samples: Sequence[tuple[object, ...]], place: Array) -> Array:
    if not samples:
        return column
    both = np.concatenate([column, np.array(samples, column.dtype)])
    return both[np.argsort(place[both["message"]], kind="stable")]

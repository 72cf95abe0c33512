"""The samples of a tag on the wire. This module needs only the standard library, because tags import it.

Two payloads carry the same frame: packed little-endian structs and JSON. The Zenoh encoding distinguishes them. The
README of this distribution describes the packed layout byte by byte; `samples.py` defines the JSON. Decoding never
raises: it returns a `Frame`, or a `Rejection` with its reason.
"""

import json
import math
import struct
import zlib
from itertools import accumulate, pairwise
from operator import mul
from typing import Any, NamedTuple

from dropanchor_schemas.kinds import (
    KINDS,
    BearingSample,
    Frame,
    HeadingSample,
    ImuSample,
    Kind,
    PressureSample,
    RangeSample,
    ScalarKind,
    Vector,
)
from dropanchor_schemas.rejections import Reason

__all__ = [
    "COUNTS_AT",
    "ENCODING_JSON",
    "ENCODING_PACKED",
    "FLAG_BOOT_CLOCK",
    "FLAG_REPLAY",
    "HEADER",
    "KNOWN_FLAGS",
    "MAX_PAYLOAD_BYTES",
    "MAX_T_NS",
    "VERSION",
    "BearingSample",
    "Frame",
    "Header",
    "HeadingSample",
    "ImuSample",
    "PressureSample",
    "RangeSample",
    "Reason",
    "Rejection",
    "Vector",
    "anchor_number",
    "decode_packed",
    "encode_json",
    "encode_packed",
    "packed_size",
    "payload_encoding",
    "read_header",
]

ENCODING_PACKED = "application/vnd.dropanchor.samples"
ENCODING_JSON = "application/json"
VERSION = 1
FLAG_BOOT_CLOCK = 1
FLAG_REPLAY = 2
KNOWN_FLAGS = FLAG_BOOT_CLOCK | FLAG_REPLAY
MAX_PAYLOAD_BYTES = 65_536
MAX_T_NS = 2**62

# Version, flags, three counts, sequence, boot id, t0_ns, four counts. The counts that no kind uses are zero.
HEADER = struct.Struct("<BBHHHIIqHHHH")
COUNTS_AT = (2, 4, 6, 24, 26, 28, 30)
"""Byte of the header at which the u16 count of each of `KINDS` stands."""
_UNUSED_COUNTS = (0,) * (len(COUNTS_AT) - len(KINDS))
_SIZES = tuple(kind.record.size for kind in KINDS)


class Rejection(NamedTuple):
    reason: Reason
    detail: str


def payload_encoding(zenoh_encoding: str) -> str:
    """Return the encoding of a payload from the Zenoh encoding of its message.

    zenoh-pico cannot send an encoding that Zenoh has no number for: it sends it as the schema of `zenoh/bytes`."""
    return zenoh_encoding.removeprefix("zenoh/bytes;")


def anchor_number(anchor: int | str) -> int:
    """Return the u32 that names an anchor in packed payloads.

    A canonical decimal ("7", not "07") below 2³² gives that number. Any other text gives the CRC-32 (IEEE) of its
    UTF-8.
    Raises ValueError for numbers outside u32 and for empty text.
    """
    if isinstance(anchor, str):
        if anchor.isascii() and anchor.isdigit() and str(int(anchor)) == anchor and int(anchor) < 2**32:
            return int(anchor)
        if not anchor:
            raise ValueError("an anchor id is not empty")
        return zlib.crc32(anchor.encode())
    if not 0 <= anchor < 2**32:
        raise ValueError(f"an anchor number is between 0 and 2**32 - 1, not {anchor}")
    return anchor


def encode_packed(frame: Frame) -> bytes:
    """Return the packed payload of a frame.

    Raises ValueError if the samples span more than 4,294 s, if the payload would exceed MAX_PAYLOAD_BYTES, or if a
    value does not fit into its field (a number beyond float32, an anchor beyond u32).
    """
    times = frame.times()
    t0_ns = min(times, default=0)
    if _dt_us(max(times, default=0), t0_ns) >= 2**32:
        raise ValueError("the samples of one frame span at most 4,294 s")
    size = packed_size(*frame.counts())
    if size > MAX_PAYLOAD_BYTES:
        raise ValueError(f"a payload has at most {MAX_PAYLOAD_BYTES} bytes, this one would have {size}")
    try:
        return _packed(frame, t0_ns)
    except (struct.error, OverflowError) as error:
        raise ValueError(f"a value does not fit into its field: {error}") from error


def packed_size(*counts: int) -> int:
    """Return the size, in bytes, of a packed payload with these counts of samples, one for each of `KINDS`."""
    size: int = HEADER.size + sum(map(mul, _SIZES, counts))
    return size


def decode_packed(payload: bytes) -> Frame | Rejection:
    """Decode a packed payload. Return its frame, or a rejection. This checks the form only, not the values."""
    header = read_header(payload)
    if isinstance(header, Rejection):
        return header
    flags, counts, sequence, boot_id, t0_ns = header
    frame = Frame(
        sequence=sequence, boot_id=boot_id, boot_clock=bool(flags & FLAG_BOOT_CLOCK), replay=bool(flags & FLAG_REPLAY)
    )
    places = pairwise(accumulate(map(mul, _SIZES, counts), initial=HEADER.size))
    for (kind, samples), (begin, end) in zip(frame.by_kind(), places, strict=True):
        records = kind.record.iter_unpack(payload[begin:end])
        samples += [kind.from_numbers(t0_ns + 1000 * v[0], *v[1:]) for v in records]
    return frame


Header = tuple[int, tuple[int, ...], int, int, int]


def read_header(payload: bytes) -> Header | Rejection:
    """Check the form of a packed payload and return its header, or a rejection.

    The header is (flags, count of each of `KINDS`, sequence, boot id, t0_ns).
    """
    if len(payload) == 0:
        return Rejection(Reason.PAYLOAD_EMPTY, "the payload is empty")
    if len(payload) > MAX_PAYLOAD_BYTES:
        return Rejection(Reason.PAYLOAD_TOO_LARGE, f"{len(payload)} bytes, at most {MAX_PAYLOAD_BYTES}")
    if payload[0] != VERSION:
        return Rejection(Reason.VERSION_UNKNOWN, f"version {payload[0]}, this decoder knows {VERSION}")
    if len(payload) < HEADER.size:
        return Rejection(Reason.HEADER_TRUNCATED, f"{len(payload)} bytes, the header alone has {HEADER.size}")
    values = HEADER.unpack_from(payload)
    flags, sequence, boot_id, t0_ns = values[1], *values[5:8]
    slots = values[2:5] + values[8:]
    counts, unused = slots[: len(KINDS)], slots[len(KINDS) :]
    if flags & ~KNOWN_FLAGS:
        return Rejection(Reason.FLAGS_UNKNOWN, f"flags {flags:#04x}, this decoder knows {KNOWN_FLAGS:#04x}")
    if any(unused):
        return Rejection(Reason.RESERVED_NOT_ZERO, f"bytes {COUNTS_AT[len(KINDS)]} to 31 must be zero")
    size = packed_size(*counts)
    if len(payload) != size:
        return Rejection(Reason.LENGTH_MISMATCH, f"{len(payload)} bytes, counts {counts} need {size}")
    if not any(counts):
        return Rejection(Reason.NO_SAMPLES, "all counts are zero")
    if not 0 <= t0_ns < MAX_T_NS:
        return Rejection(Reason.TIME_OUT_OF_RANGE, f"t0_ns {t0_ns} is not between 0 and 2**62")
    return flags, counts, sequence, boot_id, t0_ns


def encode_json(frame: Frame) -> bytes:
    """Return the JSON payload of a frame. Raises ValueError for values that JSON cannot hold, such as NaN."""
    message: dict[str, Any] = {"version": VERSION, "clock": "boot" if frame.boot_clock else "utc"}
    if frame.replay:
        message["replay"] = True
    if frame.sequence is not None:
        message["sequence"] = frame.sequence
    if frame.boot_id is not None:
        message["boot_id"] = frame.boot_id
    message |= {kind.name: [_json_of(frame, kind, s) for s in samples] for kind, samples in frame.by_kind() if samples}
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode()


def _packed(frame: Frame, t0_ns: int) -> bytes:
    parts = [_pack_header(frame, t0_ns)]
    for kind, samples in frame.by_kind():
        pack, numbers = kind.record.pack, kind.numbers
        parts += [pack(_dt_us(sample.t_ns, t0_ns), *numbers(sample)) for sample in samples]
    return b"".join(parts)


def _pack_header(frame: Frame, t0_ns: int) -> bytes:
    flags = FLAG_BOOT_CLOCK * frame.boot_clock | FLAG_REPLAY * frame.replay
    counts = (*frame.counts(), *_UNUSED_COUNTS)
    ids = (frame.sequence or 0) % 2**32, frame.boot_id or 0
    return HEADER.pack(VERSION, flags, *counts[:3], *ids, t0_ns, *counts[3:])


def _dt_us(t_ns: int, t0_ns: int) -> int:
    return (t_ns - t0_ns + 500) // 1000


def _json_of(frame: Frame, kind: Kind, sample: Any) -> dict[str, Any]:
    """Return a sample as JSON has it: without unknown values, with the name of its anchor."""
    values = {name: value for name, value in sample._asdict().items() if value is not None}
    if isinstance(kind, ScalarKind) and math.isnan(values[kind.second]):
        del values[kind.second]
    if "anchor" in values:
        values["anchor"] = frame.anchor_names.get(sample.anchor, sample.anchor)
    return values

"""The samples of a tag on the wire. This module needs only the standard library, because tags import it.

Two payloads carry the same frame: packed little-endian structs and JSON. The Zenoh encoding distinguishes them. The
README of this distribution describes the packed layout byte by byte; `samples.py` defines the JSON. Decoding never
raises: it returns a `Frame`, or a `Rejection` with its reason.
"""

import json
import math
import struct
import zlib
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple

ENCODING_PACKED = "application/vnd.dropanchor.samples"
ENCODING_JSON = "application/json"
VERSION = 1
FLAG_BOOT_CLOCK = 1
FLAG_REPLAY = 2
KNOWN_FLAGS = FLAG_BOOT_CLOCK | FLAG_REPLAY
MAX_PAYLOAD_BYTES = 65_536
MAX_T_NS = 2**62

HEADER = struct.Struct("<BBHHHIIqHHI")
IMU = struct.Struct("<I9f")
RANGE = struct.Struct("<IIff")
HEADING = struct.Struct("<Iff")
BEARING = struct.Struct("<IIff")

_NO_FIELD = (math.nan, math.nan, math.nan)

Vector = tuple[float, float, float]


class Reason(StrEnum):
    """Why a payload, a sample or a key was rejected. The service counts rejections by these names."""

    ENCODING_UNKNOWN = "encoding_unknown"
    PAYLOAD_EMPTY = "payload_empty"
    PAYLOAD_TOO_LARGE = "payload_too_large"
    HEADER_TRUNCATED = "header_truncated"
    VERSION_UNKNOWN = "version_unknown"
    FLAGS_UNKNOWN = "flags_unknown"
    RESERVED_NOT_ZERO = "reserved_not_zero"
    LENGTH_MISMATCH = "length_mismatch"
    NO_SAMPLES = "no_samples"
    JSON_SYNTAX = "json_syntax"
    JSON_SCHEMA = "json_schema"
    TIME_OUT_OF_RANGE = "time_out_of_range"
    NOT_FINITE = "not_finite"
    RANGE_NEGATIVE = "range_negative"
    RANGE_ABSURD = "range_absurd"
    IMU_ABSURD = "imu_absurd"
    HEADING_ABSURD = "heading_absurd"
    BEARING_ABSURD = "bearing_absurd"
    STD_INVALID = "std_invalid"
    ANCHOR_UNKNOWN = "anchor_unknown"
    LATE = "late"
    DUPLICATE = "duplicate"
    KEY_INVALID = "key_invalid"
    TAG_UNKNOWN = "tag_unknown"
    TAG_UNPROVEN = "tag_unproven"
    TAG_QUARANTINED = "tag_quarantined"
    TAGS_FULL = "tags_full"
    SHED = "shed"
    ESTIMATOR_FAULT = "estimator_fault"


class Rejection(NamedTuple):
    reason: Reason
    detail: str


class ImuSample(NamedTuple):
    """One IMU sample; body frame x forward, y left, z up.

    acc: specific force, m/s². gyro: angular rate, rad/s. mag: magnetic field, µT; None without a magnetometer.
    """

    t_ns: int
    acc: Vector
    gyro: Vector
    mag: Vector | None = None


class RangeSample(NamedTuple):
    """Slant range to the anchor with this number, m. std_m: standard deviation, NaN if unknown."""

    t_ns: int
    anchor: int
    range_m: float
    std_m: float = math.nan


class HeadingSample(NamedTuple):
    """Heading from the tag's platform, counter-clockwise from east, rad. std_rad: NaN if unknown."""

    t_ns: int
    heading_rad: float
    std_rad: float = math.nan


class BearingSample(NamedTuple):
    """Bearing of the tag seen from the anchor, counter-clockwise from east, rad. std_rad: NaN if unknown."""

    t_ns: int
    anchor: int
    bearing_rad: float
    std_rad: float = math.nan


@dataclass(slots=True)
class Frame:
    """The samples of one message. Times are UTC, or since the tag's boot if `boot_clock` is set.

    sequence: message counter of the publisher; None if it does not count.
    boot_id: random number, drawn at each start of the publisher. With None or 0 its messages are not numbered.
    replay: whether the samples come from a replayed recording; their times are those of the recording.
    anchor_names: number → name of the anchors that the message names by text.
    """

    imu: list[ImuSample] = field(default_factory=list)
    ranges: list[RangeSample] = field(default_factory=list)
    headings: list[HeadingSample] = field(default_factory=list)
    bearings: list[BearingSample] = field(default_factory=list)
    sequence: int | None = None
    boot_id: int | None = None
    boot_clock: bool = False
    replay: bool = False
    anchor_names: dict[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.imu) + len(self.ranges) + len(self.headings) + len(self.bearings)

    def times(self) -> list[int]:
        groups = (self.imu, self.ranges, self.headings, self.bearings)
        return [sample.t_ns for group in groups for sample in group]


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
    size = packed_size(len(frame.imu), len(frame.ranges), len(frame.headings), len(frame.bearings))
    if size > MAX_PAYLOAD_BYTES:
        raise ValueError(f"a payload has at most {MAX_PAYLOAD_BYTES} bytes, this one would have {size}")
    try:
        return _packed(frame, t0_ns)
    except (struct.error, OverflowError) as error:
        raise ValueError(f"a value does not fit into its field: {error}") from error


def packed_size(imu: int, ranges: int, headings: int, bearings: int) -> int:
    """Return the size, in bytes, of a packed payload with these counts of samples."""
    return HEADER.size + IMU.size * imu + RANGE.size * ranges + HEADING.size * headings + BEARING.size * bearings


def decode_packed(payload: bytes) -> Frame | Rejection:
    """Decode a packed payload. Return its frame, or a rejection. This checks the form only, not the values."""
    header = read_header(payload)
    if isinstance(header, Rejection):
        return header
    flags, counts, sequence, boot_id, t0_ns = header
    imu_at = HEADER.size
    range_at = imu_at + IMU.size * counts[0]
    heading_at = range_at + RANGE.size * counts[1]
    bearing_at = heading_at + HEADING.size * counts[2]
    return Frame(
        imu=[_imu(t0_ns, *v) for v in IMU.iter_unpack(payload[imu_at:range_at])],
        ranges=[RangeSample(t0_ns + 1000 * v[0], *v[1:]) for v in RANGE.iter_unpack(payload[range_at:heading_at])],
        headings=[
            HeadingSample(t0_ns + 1000 * v[0], *v[1:]) for v in HEADING.iter_unpack(payload[heading_at:bearing_at])
        ],
        bearings=[BearingSample(t0_ns + 1000 * v[0], *v[1:]) for v in BEARING.iter_unpack(payload[bearing_at:])],
        sequence=sequence,
        boot_id=boot_id,
        boot_clock=bool(flags & FLAG_BOOT_CLOCK),
        replay=bool(flags & FLAG_REPLAY),
    )


Header = tuple[int, tuple[int, int, int, int], int, int, int]


def read_header(payload: bytes) -> Header | Rejection:
    """Check the form of a packed payload and return its header, or a rejection.

    The header is (flags, counts of imu/range/heading/bearing, sequence, boot id, t0_ns).
    """
    if len(payload) == 0:
        return Rejection(Reason.PAYLOAD_EMPTY, "the payload is empty")
    if len(payload) > MAX_PAYLOAD_BYTES:
        return Rejection(Reason.PAYLOAD_TOO_LARGE, f"{len(payload)} bytes, at most {MAX_PAYLOAD_BYTES}")
    if payload[0] != VERSION:
        return Rejection(Reason.VERSION_UNKNOWN, f"version {payload[0]}, this decoder knows {VERSION}")
    if len(payload) < HEADER.size:
        return Rejection(Reason.HEADER_TRUNCATED, f"{len(payload)} bytes, the header alone has {HEADER.size}")
    _, flags, *first, sequence, boot_id, t0_ns, last, zero16, zero32 = HEADER.unpack_from(payload)
    counts = (first[0], first[1], first[2], last)
    if flags & ~KNOWN_FLAGS:
        return Rejection(Reason.FLAGS_UNKNOWN, f"flags {flags:#04x}, this decoder knows {KNOWN_FLAGS:#04x}")
    if zero16 or zero32:
        return Rejection(Reason.RESERVED_NOT_ZERO, "bytes 26 to 31 must be zero")
    if len(payload) != packed_size(*counts):
        return Rejection(Reason.LENGTH_MISMATCH, f"{len(payload)} bytes, counts {counts} need {packed_size(*counts)}")
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
    groups = {
        "imu": [_without_unknown(s._asdict()) for s in frame.imu],
        "range": [_named(frame, _without_unknown(s._asdict())) for s in frame.ranges],
        "heading": [_without_unknown(s._asdict()) for s in frame.headings],
        "bearing": [_named(frame, _without_unknown(s._asdict())) for s in frame.bearings],
    }
    message |= {name: samples for name, samples in groups.items() if samples}
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode()


def _packed(frame: Frame, t0_ns: int) -> bytes:
    parts = [_pack_header(frame, t0_ns)]
    parts += [IMU.pack(_dt_us(s.t_ns, t0_ns), *s.acc, *s.gyro, *(s.mag or _NO_FIELD)) for s in frame.imu]
    parts += [RANGE.pack(_dt_us(s.t_ns, t0_ns), s.anchor, s.range_m, s.std_m) for s in frame.ranges]
    parts += [HEADING.pack(_dt_us(s.t_ns, t0_ns), s.heading_rad, s.std_rad) for s in frame.headings]
    parts += [BEARING.pack(_dt_us(s.t_ns, t0_ns), s.anchor, s.bearing_rad, s.std_rad) for s in frame.bearings]
    return b"".join(parts)


def _pack_header(frame: Frame, t0_ns: int) -> bytes:
    flags = FLAG_BOOT_CLOCK * frame.boot_clock | FLAG_REPLAY * frame.replay
    counts = len(frame.imu), len(frame.ranges), len(frame.headings)
    ids = (frame.sequence or 0) % 2**32, frame.boot_id or 0
    return HEADER.pack(VERSION, flags, *counts, *ids, t0_ns, len(frame.bearings), 0, 0)


def _dt_us(t_ns: int, t0_ns: int) -> int:
    return (t_ns - t0_ns + 500) // 1000


def _imu(t0_ns: int, dt_us: int, *v: float) -> ImuSample:
    mag = None if math.isnan(v[6]) and math.isnan(v[7]) and math.isnan(v[8]) else (v[6], v[7], v[8])
    return ImuSample(t0_ns + 1000 * dt_us, (v[0], v[1], v[2]), (v[3], v[4], v[5]), mag)


def _without_unknown(sample: dict[str, Any]) -> dict[str, Any]:
    return {
        name: value
        for name, value in sample.items()
        if value is not None and not (name.startswith("std_") and math.isnan(value))
    }


def _named(frame: Frame, sample: dict[str, Any]) -> dict[str, Any]:
    return sample | {"anchor": frame.anchor_names.get(sample["anchor"], sample["anchor"])}

"""Writes golden_frames.json: frames, their packed payloads, and payloads that are refused, by the Python codec.

Run `python tests/support/golden.py` after a change of the contract. The codecs in Python, C and TypeScript must give
these bytes. Times are text, because a JavaScript number cannot hold them; an unknown value is null.
"""

import json
import math
from pathlib import Path
from typing import Any

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.wire import (
    BearingSample,
    Frame,
    HeadingSample,
    ImuSample,
    PressureSample,
    RangeSample,
    Rejection,
    encode_packed,
    read_header,
)

FILE = Path(__file__).parent / "golden_frames.json"
T = 1_760_000_000_000_000_000

FRAMES = {
    "one range": Frame(ranges=[RangeSample(T, 7, 12.25)], sequence=41, boot_id=0xDEADBEEF),
    "every kind": Frame(
        imu=[
            ImuSample(T, (0.0, 0.0, 9.8125), (0.0, 0.0, 0.125), (0.0, 20.0, -44.0)),
            ImuSample(T + 10_000_499, (0.1, -0.2, 9.7), (1e-3, -2e-3, 3e-3)),
        ],
        ranges=[RangeSample(T + 10_000_500, 7, 12.25, 0.125), RangeSample(T + 12_500_000, 1003233882, 3.3)],
        headings=[HeadingSample(T + 20_000_000, 1.5, 0.0625), HeadingSample(T + 30_000_000, -3.1)],
        bearings=[BearingSample(T + 30_000_001, 4294967295, -0.5), BearingSample(T + 1, 0, 0.7, 0.01)],
        pressures=[PressureSample(T + 2_000, 101_325.0, 21.5), PressureSample(T + 40_000_000, 95_000.5)],
        sequence=2**32 - 1,
        boot_id=1,
    ),
    "since boot, newest first": Frame(
        ranges=[RangeSample(5_000_001_500, 1, 0.0, 1e-3), RangeSample(1, 1, 1e-30)],
        sequence=0,
        boot_id=2**32 - 1,
        boot_clock=True,
    ),
    "of a recording": Frame(ranges=[RangeSample(T, 7, 1.5)], sequence=3, boot_id=4, replay=True),
    "longest span": Frame(
        headings=[HeadingSample(0, 0.1), HeadingSample(4_294_967_295_000, 0.2)], sequence=7, boot_id=9
    ),
    "latest time": Frame(ranges=[RangeSample(2**62 - 1, 3, 999.5)], sequence=1, boot_id=2),
    "not numbered": Frame(imu=[ImuSample(T, (-1.5, 2.5, 3.4e38), (0.0, -0.0, 1e-42))]),
}

# A kind is part of the file once a frame above has it, because all codecs must know it then.
GOLDEN_KINDS = [kind for kind in KINDS if any(getattr(frame, kind.field) for frame in FRAMES.values())]


def refused() -> dict[str, bytes]:
    whole = encode_packed(FRAMES["one range"])
    header = whole[:32]
    return {
        "empty": b"",
        "another version": b"\x02" + whole[1:],
        "truncated": whole[:31],
        "unknown flag": whole[:1] + b"\x04" + whole[2:],
        "reserved bytes": whole[:31] + b"\x01" + whole[32:],
        "a byte too few": whole[:-1],
        "a byte too many": whole + b"\x00",
        "no samples": header[:4] + b"\x00\x00" + header[6:],
        "before 1970": whole[:23] + b"\x80" + whole[24:],
        "after 2116": whole[:23] + b"\x40" + whole[24:],
    }


def described(frame: Frame) -> dict[str, Any]:
    return {
        "boot_clock": frame.boot_clock,
        "replay": frame.replay,
        "sequence": frame.sequence or 0,
        "boot_id": frame.boot_id or 0,
        **{kind.name: [_described(sample) for sample in getattr(frame, kind.field)] for kind in GOLDEN_KINDS},
    }


def document() -> str:
    frames = {name: {"frame": described(frame), "packed": encode_packed(frame).hex()} for name, frame in FRAMES.items()}
    rejected = {name: {"packed": data.hex(), "reason": _reason(data)} for name, data in refused().items()}
    return json.dumps({"frames": frames, "refused": rejected}, indent=1) + "\n"


def _described(sample: Any) -> dict[str, Any]:
    values = sample._asdict()
    unknown = {name: None for name, value in values.items() if isinstance(value, float) and math.isnan(value)}
    described: dict[str, Any] = values | unknown | {"t_ns": str(sample.t_ns)}
    return described


def _reason(data: bytes) -> str:
    header = read_header(data)
    assert isinstance(header, Rejection)
    return header.reason.value


if __name__ == "__main__":
    FILE.write_text(document())

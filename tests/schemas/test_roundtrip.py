"""A frame survives both payloads."""

import math

from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import (
    Frame,
    HeadingSample,
    ImuSample,
    RangeSample,
    anchor_number,
    decode_packed,
    encode_json,
    encode_packed,
)

T = 1_760_000_000_000_000_000


def frame() -> Frame:
    return Frame(
        imu=[
            ImuSample(T, (0.5, -0.25, 9.75), (0.0, 0.125, -1.0)),
            ImuSample(T + 10_000_000, (0.0, 0.0, 9.0), (0.0, 0.0, 1.0), (1.0, 2.0, 3.0)),
        ],
        ranges=[RangeSample(T + 5_000_000, anchor_number("L0"), 12.5, 0.25)],
        headings=[HeadingSample(T + 1_000, 1.5)],
        sequence=7,
        boot_id=99,
        anchor_names={anchor_number("L0"): "L0"},
    )


def without_names(value: Frame) -> str:
    value.anchor_names = {}
    return repr(value)


def test_a_frame_survives_the_packed_payload() -> None:
    decoded = decode_packed(encode_packed(frame()))
    assert isinstance(decoded, Frame)
    assert without_names(decoded) == without_names(frame())
    assert math.isnan(decoded.headings[0].std_rad)


def test_a_frame_survives_the_json_payload_with_the_names_of_its_anchors() -> None:
    decoded = decode_json(encode_json(frame()))
    assert isinstance(decoded, Frame)
    assert decoded.anchor_names == {anchor_number("L0"): "L0"}
    assert without_names(decoded) == without_names(frame())

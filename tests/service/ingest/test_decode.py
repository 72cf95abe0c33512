"""The columns of many payloads equal the frames of the decoders of the contract."""

import math
import random

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    HEADER,
    BearingSample,
    Frame,
    HeadingSample,
    ImuSample,
    RangeSample,
    Reason,
    Rejection,
    decode_packed,
    encode_json,
    encode_packed,
)
from dropanchor_service.estimation.columns import IMU
from dropanchor_service.ingest.decode import IMU_SAMPLE, Decoded, decode

T = 1_760_000_000_000_000_000

times = st.integers(0, 4_000_000).map(lambda us: T + 1000 * us)
floats = st.floats(width=32)
vectors = st.tuples(floats, floats, floats)
numbers = st.integers(0, 2**32 - 1)
frames = st.builds(
    Frame,
    imu=st.lists(st.builds(ImuSample, times, vectors, vectors, st.none() | vectors), max_size=4),
    ranges=st.lists(st.builds(RangeSample, times, numbers, floats, floats), max_size=4),
    headings=st.lists(st.builds(HeadingSample, times, floats, floats), max_size=3),
    bearings=st.lists(st.builds(BearingSample, times, numbers, floats, floats), max_size=3),
    sequence=numbers,
    boot_id=numbers,
    boot_clock=st.booleans(),
    replay=st.booleans(),
)


def as_text(imu: object, ranges: object, headings: object, bearings: object) -> str:
    """Return the samples as text, in which NaN equals NaN."""
    return repr((imu, ranges, headings, bearings))


def samples_of(decoded: Decoded, index: int) -> str:
    imu = [
        ImuSample(
            int(s["t_ns"]),
            tuple(s["acc"].tolist()),
            tuple(s["gyro"].tolist()),
            None if np.isnan(s["mag"]).all() else tuple(s["mag"].tolist()),
        )
        for s in decoded.imu[decoded.imu["message"] == index]
    ]
    ranges = [RangeSample(*s.tolist()[1:]) for s in decoded.ranges if s["message"] == index]
    headings = [HeadingSample(s[1], *s[3:]) for s in decoded.headings.tolist() if s[0] == index]
    bearings = [BearingSample(*s[1:]) for s in decoded.bearings.tolist() if s[0] == index]
    return as_text(imu, ranges, headings, bearings)


def assert_equal_to_the_contract(payloads: list[bytes]) -> None:
    decoded = decode(payloads, [ENCODING_PACKED] * len(payloads))
    rejected = dict(decoded.rejected)
    for index, payload in enumerate(payloads):
        expected = decode_packed(payload)
        form = decoded.forms[index]
        if isinstance(expected, Rejection):
            assert rejected[index] == expected.reason
            assert not form["accepted"]
            assert samples_of(decoded, index) == as_text([], [], [], [])
            continue
        assert index not in rejected
        assert form["accepted"]
        assert (form["sequence"], form["boot_id"]) == (expected.sequence, expected.boot_id)
        assert form["boot_clock"] == expected.boot_clock
        assert form["replay"] == expected.replay
        assert samples_of(decoded, index) == as_text(
            expected.imu, expected.ranges, expected.headings, expected.bearings
        )


@given(st.lists(frames, max_size=5))
def test_packed_payloads_decode_to_the_samples_of_the_contract(some: list[Frame]) -> None:
    assert_equal_to_the_contract([encode_packed(frame) for frame in some])


@given(st.lists(st.binary(max_size=200), max_size=6))
def test_any_bytes_are_rejected_for_the_reason_of_the_contract(payloads: list[bytes]) -> None:
    assert_equal_to_the_contract(payloads)


def test_mutated_frames_agree_with_the_contract_and_leave_their_neighbours_alone() -> None:
    dice = random.Random(7)
    good = encode_packed(frame_of_all_kinds())
    payloads = []
    for _ in range(800):
        payload = bytearray(good)
        for _ in range(dice.randint(0, 3)):
            payload[dice.randrange(min(len(payload), 40 if dice.random() < 0.7 else len(payload)))] = dice.randrange(
                256
            )
        payloads.append(bytes(payload[: dice.choice((len(payload), len(payload), dice.randrange(len(payload) + 1)))]))
    assert_equal_to_the_contract(payloads)
    assert len({reason for _, reason in decode(payloads, [ENCODING_PACKED] * 800).rejected}) >= 6


def frame_of_all_kinds() -> Frame:
    return Frame(
        imu=[
            ImuSample(T, (0.5, -0.25, 9.75), (0.0, 0.125, -1.0)),
            ImuSample(T + 1000, (1.0, 2.0, 3.0), (0, 0, 0), (1, 2, 3)),
        ],
        ranges=[RangeSample(T + 5_000_000, 3_000_000_000, 12.5, 0.25)],
        headings=[HeadingSample(T + 1_000_000, 1.5)],
        bearings=[BearingSample(T + 2_000_000, 7, -0.5, 0.125)],
        sequence=7,
        boot_id=99,
    )


def test_json_and_packed_payloads_mix_and_stay_in_order_of_arrival() -> None:
    one = encode_json(Frame(ranges=[RangeSample(T, 7, 1.5)], sequence=1, boot_id=5))
    two = encode_packed(Frame(ranges=[RangeSample(T, 8, 2.5)], sequence=2, boot_id=6))
    decoded = decode(
        [one, two, one, b"{"], [ENCODING_JSON, ENCODING_PACKED, ENCODING_JSON + ";charset=utf-8", ENCODING_JSON]
    )
    assert decoded.ranges["message"].tolist() == [0, 1, 2]
    assert decoded.ranges["value"].tolist() == [1.5, 2.5, 1.5]
    assert decoded.forms["sequence"].tolist() == [1, 2, 1, 0]
    assert decoded.rejected == [(3, Reason.JSON_SYNTAX)]


def test_json_gives_the_same_columns_as_packed() -> None:
    frame = frame_of_all_kinds()
    decoded = decode([encode_json(frame), encode_packed(frame)], [ENCODING_JSON, ENCODING_PACKED])
    assert samples_of(decoded, 0) == samples_of(decoded, 1)
    assert isinstance(decode_json(encode_json(frame)), Frame)


def test_anchor_names_are_kept() -> None:
    payload = b'{"range":[{"t_ns":1,"anchor":"gate","range_m":1.0}]}'
    decoded = decode([payload], [ENCODING_JSON])
    assert list(decoded.anchor_names.values()) == ["gate"]
    assert decoded.ranges["anchor"].tolist() == list(decoded.anchor_names)


def test_imu_samples_have_the_memory_layout_of_the_engine() -> None:
    assert IMU_SAMPLE.itemsize == IMU.itemsize
    layouts = [list((dtype.fields or {}).values()) for dtype in (IMU_SAMPLE, IMU)]
    assert layouts[0] == layouts[1]


def test_an_unknown_encoding_is_rejected_with_that_reason() -> None:
    decoded = decode([b"x", b""], ["zenoh/bytes", "text/plain"])
    assert decoded.rejected == [(0, Reason.ENCODING_UNKNOWN), (1, Reason.ENCODING_UNKNOWN)]


def test_no_payloads_give_empty_columns() -> None:
    decoded = decode([], [])
    assert len(decoded.forms) == len(decoded.imu) == len(decoded.ranges) == 0


def test_a_message_without_a_boot_id_is_not_numbered() -> None:
    payload = encode_packed(Frame(ranges=[RangeSample(T, 1, math.pi)], sequence=4))
    assert HEADER.unpack_from(payload)[6] == 0
    assert not decode([payload], [ENCODING_PACKED]).forms["numbered"][0]

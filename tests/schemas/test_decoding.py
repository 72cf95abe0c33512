"""Any bytes decode to a frame or to a named rejection."""

import json
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import (
    COUNTS_AT,
    HEADER,
    MAX_PAYLOAD_BYTES,
    Frame,
    Reason,
    Rejection,
    decode_packed,
    encode_json,
    encode_packed,
)
from support.payloads import T, frames, mutated_payloads

headers = st.builds(
    HEADER.pack,
    *(st.sampled_from([1, 1, 1, 0, 2]), st.sampled_from([0, 0, 1, 2, 255])),
    *(st.integers(0, 3), st.integers(0, 3), st.integers(0, 3)),
    *(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1), st.integers(-(2**63), 2**63 - 1)),
    *(st.integers(0, 3), *[st.sampled_from([0, 0, 0, 1])] * 3),
)


def check(payload: bytes) -> None:
    for decode in (decode_packed, decode_json):
        decoded = decode(payload)
        if isinstance(decoded, Frame):
            assert len(decoded) > 0
            assert len(decoded.times()) == len(decoded)
            assert all(isinstance(t_ns, int) and 0 <= t_ns < 2**63 for t_ns in decoded.times())
        else:
            assert isinstance(decoded.reason, Reason)
            assert decoded.detail
            assert len(decoded.detail) < 300


@given(st.binary(max_size=400))
def test_any_bytes_decode_to_a_frame_or_a_rejection(payload: bytes) -> None:
    check(payload)


@given(st.builds(lambda header, rest: header + rest, headers, st.binary(max_size=200)))
def test_any_header_with_any_body_decodes_to_a_frame_or_a_rejection(payload: bytes) -> None:
    check(payload)


@given(st.recursive(st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5), st.lists))
def test_any_json_decodes_to_a_frame_or_a_rejection(value: object) -> None:
    check(json.dumps(value).encode())
    check(json.dumps({"range": value, "version": value}).encode())


@given(mutated_payloads())
def test_mutated_payloads_decode_to_a_frame_or_a_rejection(payload: bytes) -> None:
    check(payload)


@given(frames())
def test_every_frame_survives_both_payloads(frame: Frame) -> None:
    assert repr(decode_packed(encode_packed(frame))) == repr(frame)
    assert repr(decode_json(encode_json(frame))) == repr(frame)


@given(frames(), st.data())
def test_a_truncated_packed_payload_is_always_rejected(frame: Frame, data: st.DataObject) -> None:
    payload = encode_packed(frame)
    assert isinstance(decode_packed(payload[: data.draw(st.integers(0, len(payload) - 1))]), Rejection)


def header(*, version: int = 1, flags: int = 0, ranges: int = 1, t0_ns: int = T) -> bytes:
    return HEADER.pack(version, flags, 0, ranges, 0, 1, 1, t0_ns, 0, 0, 0, 0)


ONE = struct.pack("<IIff", 0, 7, 1.0, 0.1)
PACKED = {
    Reason.PAYLOAD_EMPTY: [b""],
    Reason.PAYLOAD_TOO_LARGE: [header(ranges=4095) + ONE * 4095],
    Reason.HEADER_TRUNCATED: [b"\x01", header()[:31]],
    Reason.VERSION_UNKNOWN: [b"\x02", header(version=0) + ONE, header(version=2) + ONE],
    Reason.FLAGS_UNKNOWN: [header(flags=4) + ONE, header(flags=0x81) + ONE],
    Reason.RESERVED_NOT_ZERO: [header()[:at] + b"\1" + header()[at + 1 :] + ONE for at in COUNTS_AT[len(KINDS) :]],
    Reason.LENGTH_MISMATCH: [header(), header() + ONE[:-1], header() + ONE + b"\0", header(ranges=0) + ONE],
    Reason.NO_SAMPLES: [header(ranges=0)],
    Reason.TIME_OUT_OF_RANGE: [header(t0_ns=-1) + ONE, header(t0_ns=2**62) + ONE],
}
RANGE_JSON = b'{"range": [{"t_ns": 1, "anchor": 7, "range_m": 1%s}]}'
JSON = {
    Reason.PAYLOAD_EMPTY: [b""],
    Reason.PAYLOAD_TOO_LARGE: [RANGE_JSON % (b" " * MAX_PAYLOAD_BYTES)],
    Reason.VERSION_UNKNOWN: [b'{"version": 2}', b'{"version": 0, "range": []}', b'{"version": 3, "new": [1]}'],
    Reason.NO_SAMPLES: [b"{}", b'{"range": []}', b'{"sequence": 1, "imu": [], "heading": []}'],
    Reason.JSON_SYNTAX: [b"hello", b"{", b"\xff\xfe{\0}\0", b"\xef\xbb\xbf{}", b"[" * 60_000, b'{"range": "\\ud800"}'],
    Reason.JSON_SCHEMA: [
        *(b"[]", b"1", b"null", b'{"ranges": []}', b'{"range": {}}', b'{"clock": "gps"}', b'{"version": "2"}'),
        *(b'{"sequence": -1}', b'{"boot_id": 4294967296}', RANGE_JSON % b', "rssi": 1', b'{"version": null}'),
        *(b'{"range": [{"t_ns": %s, "anchor": 7, "range_m": 1}]}' % t for t in (b"-1", b"4611686018427387904", b"0.5")),
        *(b'{"range": [{"t_ns": 1, "anchor": %s, "range_m": 1}]}' % a for a in (b"-1", b"4294967296", b'""', b"true")),
        *(b'{"range": [{"t_ns": 1, "anchor": 7, "range_m": %s}]}' % r for r in (b"true", b'"1"', b"null", b"[1]")),
        *(b'{"range": [{"t_ns": %s, "anchor": 7, "range_m": 1}]}' % t for t in (b'"1"', b"true", b"1e18", b"9" * 400)),
        *(b'{"imu": [{"t_ns": 1, "acc": %s, "gyro": [0, 0, 0]}]}' % a for a in (b"[0, 0]", b"[0, 0, 0, 0]", b"0")),
        *(b'{"range": [{"anchor": 7, "range_m": 1}]}', b'{"heading": [{"t_ns": 1}]}', b'{"bearing": [{"t_ns": 1}]}'),
    ],
}


@pytest.mark.parametrize(("reason", "payload"), [(r, p) for r, payloads in PACKED.items() for p in payloads])
def test_a_bad_packed_payload_is_rejected_with_its_reason(reason: Reason, payload: bytes) -> None:
    decoded = decode_packed(payload)
    assert isinstance(decoded, Rejection)
    assert decoded.reason == reason


@pytest.mark.parametrize(("reason", "payload"), [(r, p) for r, payloads in JSON.items() for p in payloads])
def test_a_bad_json_payload_is_rejected_with_its_reason(reason: Reason, payload: bytes) -> None:
    decoded = decode_json(payload)
    assert isinstance(decoded, Rejection)
    assert decoded.reason == reason


def test_a_schema_error_names_its_location() -> None:
    decoded = decode_json(
        b'{"range": [{"t_ns": 1, "anchor": 7, "range_m": 1}, {"t_ns": 1, "anchor": 7, "range_m": "x"}]}'
    )
    assert decoded == (Reason.JSON_SCHEMA, "range.1.range_m: Input should be a valid number")


def test_the_largest_payload_is_accepted() -> None:
    count = (MAX_PAYLOAD_BYTES - HEADER.size) // len(ONE)
    assert isinstance(decode_packed(header(ranges=count) + ONE * count), Frame)
    assert isinstance(decode_json((RANGE_JSON % b"").ljust(MAX_PAYLOAD_BYTES)), Frame)

"""Health is decoded to the values that a tag can have measured, or to a named rejection."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_schemas.health import LIMITS, MAX_HEALTH_BYTES, encode_health
from dropanchor_schemas.tag_health import HealthReport, decode_health
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Rejection

FULL = {"battery_fraction": 0.5, "battery_v": 3.7, "temperature_c": -5.0, "firmware": "1.2", "rssi_dbm": -70.0}
SPOOL = {"spool_bytes": 2**40, "spool_oldest_s": 60.5, "lost_messages": 7}


def test_what_is_encoded_is_decoded() -> None:
    assert decode_health(encode_health(FULL | SPOOL), ENCODING_JSON) == HealthReport(FULL | SPOOL, ())


@pytest.mark.parametrize(
    ("payload", "encoding", "reason"),
    [
        (b"", ENCODING_JSON, "payload_empty"),
        (b"{}", ENCODING_JSON, "no_health"),
        (b'{"battery_fraction": null}', ENCODING_JSON, "no_health"),
        (b"{", ENCODING_JSON, "json_syntax"),
        (b"[1]", ENCODING_JSON, "json_schema"),
        (b'{"battery": 1}', ENCODING_JSON, "json_schema"),
        (b'{"battery_fraction": "1"}', ENCODING_JSON, "json_schema"),
        (b'{"spool_bytes": 1.5}', ENCODING_JSON, "json_schema"),
        (b'{"firmware": ""}', ENCODING_JSON, "json_schema"),
        (encode_health({"firmware": "x" * 65}), ENCODING_JSON, "json_schema"),
        (b'{"version": 2, "battery_fraction": 1}', ENCODING_JSON, "version_unknown"),
        (b'{"battery_fraction": 1}', ENCODING_PACKED, "encoding_unknown"),
        (b" " * (MAX_HEALTH_BYTES + 1), ENCODING_JSON, "payload_too_large"),
    ],
)
def test_a_malformed_message_is_rejected_by_name(payload: bytes, encoding: str, reason: str) -> None:
    decoded = decode_health(payload, encoding)
    assert isinstance(decoded, Rejection)
    assert decoded.reason == reason


@pytest.mark.parametrize("name", LIMITS)
@pytest.mark.parametrize("beyond", [-1, 1])
def test_a_value_beyond_its_limits_is_left_out_and_the_others_are_used(name: str, beyond: int) -> None:
    low, high = LIMITS[name]
    values = {"firmware": "1"} | {name: low - 1 if beyond < 0 else high + max(1, high * 1e-3)}
    if name in ("spool_bytes", "lost_messages"):
        values[name] = int(values[name])
    assert decode_health(encode_health(values), ENCODING_JSON) == HealthReport({"firmware": "1"}, (name,))


def test_nan_and_control_characters_are_absurd() -> None:
    decoded = decode_health(b'{"temperature_c": NaN, "firmware": "a\\u001bb"}', ENCODING_JSON)
    assert isinstance(decoded, HealthReport)
    assert (decoded.values, set(decoded.absurd)) == ({}, {"temperature_c", "firmware"})


@given(st.binary(max_size=300) | st.recursive(st.none() | st.floats() | st.text(), st.lists).map(json.dumps))
def test_nothing_makes_the_decoder_fail(payload: Any) -> None:
    data = payload if isinstance(payload, bytes) else payload.encode(errors="surrogatepass")
    assert isinstance(decode_health(data, ENCODING_JSON), HealthReport | Rejection)

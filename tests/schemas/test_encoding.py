"""Encoding rejects what it cannot express, and each anchor has one number."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_schemas.wire import Frame, HeadingSample, RangeSample, anchor_number, encode_json, encode_packed
from support.payloads import T


def headings(*times: int) -> Frame:
    return Frame(headings=[HeadingSample(t_ns, 0.0) for t_ns in times])


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (headings(T, T + 2**32 * 1000), "span at most 4,294 s"),
        (headings(T, T + 2**32 * 1000 - 400), "span at most 4,294 s"),
        (headings(*[T] * 6000), "at most 65536 bytes"),
        (Frame(ranges=[RangeSample(T, 7, 1e39)]), "does not fit"),
        (Frame(ranges=[RangeSample(T, 2**32, 1.0)]), "does not fit"),
        (Frame(ranges=[RangeSample(T, -1, 1.0)]), "does not fit"),
        (Frame(headings=[HeadingSample(2**63, 1.0)]), "does not fit"),
        (Frame(headings=[HeadingSample(T, 1.0)], boot_id=2**32), "does not fit"),
    ],
)
def test_a_frame_that_a_packed_payload_cannot_hold_is_an_error(frame: Frame, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        encode_packed(frame)


def test_the_longest_span_still_fits() -> None:
    assert len(encode_packed(headings(T, T + 2**32 * 1000 - 600))) == 56


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_nan_and_infinity_are_errors_in_json(value: float) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        encode_json(Frame(headings=[HeadingSample(T, value)]))


def test_sequences_wrap() -> None:
    frame = headings(T)
    frame.sequence = 2**32 + 5
    assert encode_packed(frame)[8:12] == b"\x05\0\0\0"


@given(st.integers(0, 2**32 - 1))
def test_a_number_and_its_decimal_name_the_same_anchor(number: int) -> None:
    assert anchor_number(number) == anchor_number(str(number)) == number


@given(st.text(st.characters(codec="utf-8"), min_size=1, max_size=64))
def test_every_text_has_a_number(text: str) -> None:
    assert 0 <= anchor_number(text) < 2**32


@pytest.mark.parametrize("text", ["07", "+7", " 7", "7.0", "٧", "4294967296", "-1"])
def test_only_the_shortest_decimal_is_a_number(text: str) -> None:
    assert anchor_number(text) != 7
    assert anchor_number(text) > 2**24  # a CRC


@pytest.mark.parametrize("anchor", ["", -1, 2**32])
def test_an_invalid_anchor_id_is_an_error(anchor: int | str) -> None:
    with pytest.raises(ValueError, match="anchor"):
        anchor_number(anchor)

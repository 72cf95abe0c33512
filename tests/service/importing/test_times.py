"""The unit of a time column comes from its values, wraps of counters are undone, and both are said."""

from decimal import Decimal

import pytest

from dropanchor_service.importing.tables.times import iso_ns, times_of

S = 1_000_000_000
UTC_NS = 1_760_000_000 * S


def steps(start: float, step: float, count: int = 50) -> list[int | float | Decimal]:
    return [Decimal(str(start)) + Decimal(str(step)) * i for i in range(count)]


@pytest.mark.parametrize(
    ("start", "step", "unit"),
    [
        (0, 0.01, "s"),
        (12.5, 0.5, "s"),
        (0, 10, "ms"),
        (73_000, 100, "ms"),
        (5, 10_000, "us"),
        (0, 10_000_000, "ns"),
        (3_925_657_519_043_709, 10_000_000, "ns"),  # of an Android phone, since its boot
        (1_760_000_000, 0.01, "s"),
        (1_760_000_000, 1, "s"),
        (1_760_000_000_000, 10, "ms"),
        (1_760_000_000_000_000, 10_000, "us"),
        (1_760_000_000_000_000_000, 10_000_000, "ns"),
    ],
)
def test_the_unit_is_that_of_a_date_of_this_century_or_of_a_usual_rate(start: float, step: float, unit: str) -> None:
    times = times_of(steps(start, step), None, "time", list(range(50)))
    assert f"--map t=time:{unit}" in times.notes[0]


def test_numbers_with_many_digits_keep_them() -> None:
    raw = [Decimal("1760000000.123456789"), Decimal("1760000000.133456789")]
    assert times_of(raw, "s", "t", [2, 3]).t_ns.tolist() == [UTC_NS + 123_456_789, UTC_NS + 133_456_789]


def test_a_counter_that_wraps_is_unwrapped_and_the_line_is_named() -> None:
    raw: list[int | float | Decimal] = [2**32 - 20_000, 2**32 - 10_000, 0, 10_000]
    times = times_of(raw, "us", "micros", [5, 6, 7, 8])
    assert ((times.t_ns - times.t_ns[0]) // 1000).tolist() == [0, 10_000, 20_000, 30_000]
    assert times.notes == ["micros: the counter wraps at 2^32 (line 7): unwrapped 1 times"]


@pytest.mark.parametrize(
    ("text", "ns", "has_zone"),
    [
        ("2025-10-09T08:53:20Z", UTC_NS, True),
        ("2025-10-09 08:53:20.5", UTC_NS + S // 2, False),
        ("2025-10-09T10:53:20,123456789+02:00", UTC_NS + 123_456_789, True),
        ("2025-10-09T08:53:20.000001Z", UTC_NS + 1000, True),
        ("13:45:07.123", 49_507_123_000_000, False),  # times of day
        ("1:45:07.123 PM", 49_507_123_000_000, False),
        ("12:00 a.m.", 0, False),
        ("12:00:01pm", 43_201_000_000_000, False),
        ("9:05:07,5", 32_707_500_000_000, False),
        ("23:59", 86_340 * S, False),
    ],
)
def test_iso_8601_is_read_to_the_nanosecond(text: str, ns: int, has_zone: bool) -> None:
    assert iso_ns(text) == (ns, has_zone)


@pytest.mark.parametrize("text", ["hello", "12.5", "-3", "2025-13-09T08:53:20Z", "2025-10", "25:00:00", "12:5:3"])
def test_other_texts_are_no_times(text: str) -> None:
    assert iso_ns(text) is None

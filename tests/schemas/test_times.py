"""A time is read as ISO 8601, and a number that cannot be UTC in ns is told from one that can."""

import pytest

from dropanchor_schemas.times import EARLIEST_UTC_NS, ns_of_iso, ns_of_parameter, unit_of, why_not_utc
from dropanchor_schemas.wire import MAX_T_NS

S = 1_000_000_000
T = 1_800_000_000 * S


@pytest.mark.parametrize(
    ("text", "t_ns"),
    [
        ("2027-01-15T08:00:00.000000000Z", T),
        ("2027-01-15T08:00:00Z", T),
        ("2027-01-15t08:00:00z", T),
        ("2027-01-15T08:00Z", T),
        ("2027-01-15T09:30:00+01:30", T),
        ("2027-01-15T03:00:00-0500", T),
        ("2027-01-15T08:00:00.5Z", T + S // 2),
        ("2027-01-15T08:00:00,123456789Z", T + 123_456_789),
        ("1969-12-31T23:59:59.25Z", -750_000_000),
    ],
)
def test_an_iso_time_is_read_to_the_nanosecond(text: str, t_ns: int) -> None:
    assert ns_of_iso(text) == t_ns


@pytest.mark.parametrize(
    ("text", "t_ns"),
    [(str(T), T), ("0", 0), ("2027-01-15t09:00:00+01:00", T), ("2027-01-15T09:00:00 01:00", T)],
)
def test_a_parameter_is_a_time_in_ns_or_iso_and_a_plus_sign_may_be_a_space(text: str, t_ns: int) -> None:
    assert ns_of_parameter(text) == t_ns


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (str(T // S), "looks like seconds: write it in ns, times 1000000000, or as 2027-01-15T08:00:00Z"),
        (f"{T // S}.25", "looks like seconds"),
        (str(T // 10**6), "looks like milliseconds: write it in ns, times 1000000"),
        (str(T // 1000), "looks like microseconds: write it in ns, times 1000"),
        (f"{T}.5", "a time in ns, or as ISO 8601 with a time zone"),
        ("", "a time in ns, or as ISO 8601 with a time zone"),
        ("9" * 5000, "out of range"),
    ],
)
def test_a_parameter_in_another_unit_is_refused_with_what_to_write(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        ns_of_parameter(text)


@pytest.mark.parametrize(
    ("t_ns", "unit"), [(T // S, "seconds"), (T // 10**6, "milliseconds"), (T // 1000, "microseconds")]
)
def test_a_time_of_our_days_in_another_unit_is_named_with_the_factor(t_ns: int, unit: str) -> None:
    said = why_not_utc(t_ns)
    assert said is not None
    assert said.startswith("t_ns is 1970-01-")
    assert f"{t_ns} looks like {unit}; multiply it by {T // t_ns}" in said


@pytest.mark.parametrize("t_ns", [0, 12_345, 12_345_000_000, 946_684_800 * S, EARLIEST_UTC_NS - 1])
def test_another_early_time_counts_from_a_start(t_ns: int) -> None:
    assert unit_of(t_ns) is None
    assert "counts from a start, such as boot; say clock boot (flag bit 0)" in (why_not_utc(t_ns) or "")


@pytest.mark.parametrize("t_ns", [EARLIEST_UTC_NS, T, MAX_T_NS - 1, MAX_T_NS, -1])
def test_nothing_is_said_of_a_time_that_may_be_utc_or_is_out_of_range(t_ns: int) -> None:
    assert why_not_utc(t_ns) is None


def test_the_example_of_the_documentation() -> None:
    assert why_not_utc(1_764_150_000_000) == (
        "t_ns is 1970-01-01T00:29:24Z: 1764150000000 looks like milliseconds; multiply it by 1000000, or say clock "
        "boot (flag bit 0) if it counts from boot"
    )

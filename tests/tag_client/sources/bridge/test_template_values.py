"""Numbers, units and times as devices write them, read by rules."""

import json
from pathlib import Path
from typing import Any

import pytest

from dropanchor_tag_client.sources.bridge.measurement import Drop, Dropped, Measurement, Received
from dropanchor_tag_client.sources.bridge.template import Template


def read(tmp_path: Path, options: str, payload: object, fields: str = "") -> dict[str, Any]:
    """Return the fields of the range in a payload {"m": …}."""
    (found,) = _found(tmp_path, options, payload, fields)
    assert isinstance(found, Measurement)
    return found.fields


def why_not(tmp_path: Path, options: str, payload: object, fields: str = "") -> str:
    """Return why there is no range in a payload {"m": …}."""
    (found,) = _found(tmp_path, options, payload, fields)
    assert isinstance(found, Dropped)
    assert found.reason is Drop.NOT_UNDERSTOOD
    return found.detail


def _found(tmp_path: Path, options: str, payload: object, fields: str) -> list[Measurement | Dropped]:
    sources = f'fields = {{anchor = "=7", range_m = "m"{fields}}}'
    (tmp_path / "rule.toml").write_text(f'[[rule]]\nkind = "range"\ntopic = "u"\ntag = "c"\n{options}\n{sources}')
    return list(Template(tmp_path / "rule.toml").parse(Received("u", json.dumps(payload).encode(), 5)))


TIME = ', t_ns = "t"'


@pytest.mark.parametrize(
    ("options", "value", "range_m"),
    [
        ("", "5.10", 5.1),
        ("", " 1e1 ", 10.0),
        ('unit = {range_m = "cm"}', "321", 3.21),
        ('unit = {range_m = "mm"}', 3210, 3.21),
        ('unit = {range_m = "ft"}', 10, 3.048),
        ("decimal_comma = true", "5,10", 5.1),
        ("decimal_comma = true", "5.10", 5.1),
    ],
)
def test_numbers_as_text_and_units_are_read(tmp_path: Path, options: str, value: object, range_m: float) -> None:
    assert read(tmp_path, options, {"m": value})["range_m"] == pytest.approx(range_m)


def test_a_decimal_comma_is_not_guessed(tmp_path: Path) -> None:
    assert "m is '5,100': decimal_comma = true in the rule says" in why_not(tmp_path, "", {"m": "5,100"})


@pytest.mark.parametrize("text", ["nan", "inf", "0x10", "5 m", "1_0", "1.234,5", ""])
def test_other_texts_are_left_for_the_check_of_the_sample_which_names_them(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, "decimal_comma = true", {"m": text})["range_m"] == text


def test_units_of_an_imu_are_converted(tmp_path: Path) -> None:
    (tmp_path / "imu.toml").write_text(
        '[[rule]]\nkind = "imu"\ntopic = "imu"\ntag = "c"\nfields = {acc = "a", gyro = ["x", "y", "z"], mag = "m"}\n'
        'unit = {acc = "g", gyro = "deg/s", mag = "G"}'
    )
    value = {"a": [0, "0", 1], "x": 180, "y": 0, "z": "90", "m": [0.2, 0, -0.4]}
    (one,) = Template(tmp_path / "imu.toml").parse(Received("imu", json.dumps(value).encode(), 5))
    assert isinstance(one, Measurement)
    found = one.fields
    assert found["acc"] == pytest.approx([0, 0, 9.80665])
    assert found["gyro"] == pytest.approx([3.14159265, 0, 1.57079633])
    assert found["mag"] == pytest.approx([20, 0, -40])


@pytest.mark.parametrize(
    ("options", "time", "t_ns"),
    [
        ("", "2026-11-26T08:00:00Z", 1_795_680_000_000_000_000),
        ("", "2026-11-26T09:00:00.123456+01:00", 1_795_680_000_123_456_000),
        ('time_zone = "Europe/Berlin"', "2026-11-26 09:00:00", 1_795_680_000_000_000_000),
        ('time_unit = "s"', "1795680000.123456789", 1_795_680_000_123_456_789),
        ('time_unit = "s"', 1795680000.5, 1_795_680_000_500_000_000),
        ('time_unit = "us"', 1795680000000001, 1_795_680_000_000_001_000),
    ],
)
def test_times_are_read(tmp_path: Path, options: str, time: object, t_ns: int) -> None:
    assert read(tmp_path, options, {"m": 1.0, "t": time}, TIME)["t_ns"] == t_ns


@pytest.mark.parametrize(
    ("time", "why"),
    [
        ("2026-11-26T08:00:00", 'without a zone: time_zone = "UTC"'),
        ("2026-11-26", "a number or a time such as 2026-11-26T08:00:00Z"),
        ("noon", "a number or a time such as"),
        ("1950-01-01T00:00:00Z", "before 1970"),
        ("0001-01-01T00:00:00+23:00", "before 1970"),
        ("9999-12-31T23:59:59-23:00", "after 2262"),
        ("1e9999999", "a number or a time such as"),
        (1e300, "which is no time in ns since 1970"),
        (-5, "which is no time in ns since 1970"),
        ("NaN", "which is no time in ns since 1970"),
        (True, "a time was expected"),
        (None, "a time was expected"),
        ([1], "a time was expected"),
    ],
)
def test_a_time_that_is_none_is_named(tmp_path: Path, time: object, why: str) -> None:
    assert why in why_not(tmp_path, "", {"m": 1.0, "t": time}, TIME)


def test_a_barometer_is_read_in_its_own_unit(tmp_path: Path) -> None:
    rule = '[[rule]]\nkind = "pressure"\ntopic = "u"\ntag = "c"\nfields = {pressure_pa = "p", temperature_c = "t"}'
    (tmp_path / "rule.toml").write_text(f'{rule}\nunit = {{pressure_pa = "hPa"}}')
    payload = json.dumps({"p": 1013.25, "t": 21.5}).encode()
    assert list(Template(tmp_path / "rule.toml").parse(Received("u", payload, 5))) == [
        Measurement("c", "pressure", {"pressure_pa": 101_325.0, "temperature_c": 21.5, "t_ns": 5})
    ]

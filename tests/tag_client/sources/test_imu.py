"""IMU chips on I²C, with fake chips that have the attributes of Adafruit's libraries."""

import sys
from contextlib import suppress
from itertools import chain
from typing import Any

import pytest

from dropanchor_schemas.wire import Vector
from dropanchor_tag_client.cli import main
from dropanchor_tag_client.sources.axes import AXES, direction, mounting
from dropanchor_tag_client.sources.chips import ChipError, Drop, Reading, Readings, open_chip
from dropanchor_tag_client.sources.self_test import self_test
from support.chips import GRAVITY, FakeChip, FakeLibraries, Motion, resting
from support.listening import listening
from support.zenoh_router import wait_until

RATE_HZ = 1000.0
MOUNTINGS = [(f, u) for f in AXES for u in AXES if f[-1] != u[-1]]


def readings_of(motion: Motion) -> Readings:
    chip = FakeChip(motion)
    return Readings(lambda: chip, RATE_HZ, lambda _: None)


def all_of(readings: Readings) -> list[Reading]:
    """Read until the motion of the fake chip is over."""
    found: list[Reading] = []
    with suppress(KeyboardInterrupt):
        found.extend(readings)
    return found


@pytest.mark.parametrize(("device", "address"), [("bno055", 0x28), ("bno085", 0x4A), ("icm20948", 0x69)])
def test_each_chip_is_opened_at_the_address_of_its_board(
    monkeypatch: pytest.MonkeyPatch, device: str, address: int
) -> None:
    libraries = FakeLibraries(monkeypatch, lambda: resting(1))
    open_chip(device, 3, None)
    open_chip(device, 3, 0x33)
    assert [opened[:3] for opened in libraries.opened] == [(device, "bus 3", address), (device, "bus 3", 0x33)]


def test_the_bno055_measures_without_its_own_fusion_and_the_bno085_all_three_fields(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    libraries = FakeLibraries(monkeypatch, lambda: resting(1))
    open_chip("bno055", 1, None)
    open_chip("bno085", 1, None)
    assert libraries.opened[0][3].mode == 7
    assert libraries.opened[1][3].enabled == [(1, 10_000), (2, 10_000), (3, 10_000)]


@pytest.mark.parametrize("device", ["bno055", "bno085", "icm20948"])
def test_a_chip_becomes_the_imu_of_a_tag_in_its_axes(
    monkeypatch: pytest.MonkeyPatch, router_endpoint: str, device: str
) -> None:
    FakeLibraries(monkeypatch, lambda: resting(60, acc=(9.81, 1.0, 2.0), gyro=(0.1, 0.2, 0.3), mag=(5.0, 6.0, 7.0)))
    arguments = ["imu", "--device", device, "--tag", "a", "--connect", router_endpoint, "--forward=-y", "--up=x"]
    with listening(router_endpoint) as heard:
        assert main(arguments) == 130
        wait_until(lambda: sum(len(frame.imu) for frame in heard.frames) == 60)
    sample = heard.frames[0].imu[0]
    body = mounting("-y", "x").to_body
    assert sample.acc == pytest.approx(body((9.81, 1.0, 2.0)))
    assert sample.gyro == pytest.approx(body((0.1, 0.2, 0.3)))
    assert sample.mag == pytest.approx(body((5.0, 6.0, 7.0)))
    times = [one.t_ns for frame in heard.frames for one in frame.imu]
    assert 0.4e9 < times[-1] - times[0] < 5e9  # 100 Hz, on a machine that may be busy


def test_gravity_names_the_axis_that_points_up_if_another_was_given(
    monkeypatch: pytest.MonkeyPatch, router_endpoint: str, caplog: pytest.LogCaptureFixture
) -> None:
    FakeLibraries(monkeypatch, lambda: resting(60, acc=(0.0, -9.81, 0.0)))
    with caplog.at_level("INFO"):
        main(["imu", "--device", "bno055", "--tag", "a", "--connect", router_endpoint])
    assert "start again with --up=-y" in caplog.text


def test_a_magnetic_field_that_was_not_measured_anew_is_left_out() -> None:
    motion = list(resting(4))
    motion[1] = (*motion[1][:2], motion[0][2])
    assert [reading.mag is None for reading in all_of(readings_of(iter(motion)))] == [False, True, False, False]


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        ((OSError(121, "Remote I/O error"), None, None), Drop.BUS_ERROR),
        ((RuntimeError("Unprocessable Batch bytes"), None, None), Drop.BUS_ERROR),
        (((None, None, None), (None, None, None), None), Drop.NOT_READY),
        ((None, None, None), Drop.NOT_READY),
        (((0.0, float("nan"), 0.0), GRAVITY, None), Drop.NOT_READY),
    ],
)
def test_bad_readings_are_named_and_counted_and_the_others_published(bad: tuple[Any, Any, Any], reason: Drop) -> None:
    readings = readings_of(chain(resting(3), [bad], resting(3, acc=(0.0, 0.0, 9.0))))
    assert len(all_of(readings)) == 6
    assert readings.dropped == {reason: 1}


def test_a_chip_that_reports_zeros_after_a_reset_is_not_published() -> None:
    readings = readings_of(chain(resting(3), [((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))] * 10))
    assert len(all_of(readings)) == 4
    assert readings.dropped == {Drop.STUCK: 9}


def test_a_chip_that_was_unplugged_is_opened_again() -> None:
    motions = iter([chain(resting(3), [(OSError(121, "Remote I/O error"), None, None)] * 100), resting(5)])
    failures = iter([True, False])
    said: list[str] = []

    def opened() -> FakeChip:
        if said == [] and readings_began and next(failures):
            raise ChipError("does not answer")
        return FakeChip(next(motions))

    readings_began = False
    readings = Readings(opened, RATE_HZ, said.append)
    readings_began = True
    assert len(all_of(readings)) == 8
    assert said == ["does not answer. Still trying.", "the chip answers again"]


def test_an_absent_chip_says_what_to_check(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    FakeLibraries(monkeypatch, lambda: resting(1)).absent = True
    assert main(["imu", "--device", "bno055", "--tag", "a"]) == 2
    assert "bno055 on I2C bus 1 does not answer" in (errors := capsys.readouterr().err)
    assert "check the wiring" in errors


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "adafruit_extended_bus", None)
    assert main(["imu", "--device", "bno055", "--tag", "a"]) == 2
    assert "pip install adafruit-extended-bus adafruit-circuitpython-bno055" in capsys.readouterr().err


def motions(forward: str, up: str, turn: float = 1.0) -> Motion:
    """Yield what a chip that is mounted like this measures: level, with its front up, and in a turn to the left."""
    f, u = direction(forward), direction(up)

    def acc(along_f: float, along_u: float) -> Vector:
        x, y, z = (9.81 * (along_f * a + along_u * b) for a, b in zip(f, u, strict=True))
        return x, y, z

    yield from resting(60, acc=acc(0.0, 1.0))
    for _ in range(30):
        yield acc(0.3, 0.9), (0.5, -0.4, 0.3), GRAVITY
    yield from resting(60, acc=acc(0.7, 0.7))
    yield from resting(40, acc=acc(0.0, 1.0))
    for _ in range(2000):
        yield acc(0.0, 1.0), tuple(turn * part for part in u), GRAVITY


@pytest.mark.parametrize(("forward", "up"), MOUNTINGS)
def test_the_self_test_finds_the_mounting(forward: str, up: str) -> None:
    said: list[str] = []
    stream = (Reading(0, acc, gyro, None) for acc, gyro, _ in motions(forward, up))
    assert self_test(stream, 100.0, said.append) == f"--forward={forward} --up={up}"
    assert said[-1].startswith(f"forward {forward}, left ")
    assert not any("mirrored" in line for line in said)


def test_the_self_test_tells_of_a_turn_in_the_wrong_direction() -> None:
    said: list[str] = []
    stream = (Reading(0, acc, gyro, None) for acc, gyro, _ in motions("x", "z", turn=-1.0))
    self_test(stream, 100.0, said.append)
    assert any("a turn to the right" in line for line in said)


def test_the_command_runs_the_self_test_and_prints_the_options(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    FakeLibraries(monkeypatch, lambda: motions("-y", "z"))
    assert main(["imu", "--device", "bno085", "--self-test", "--rate", "1000"]) in (0, 130)
    assert capsys.readouterr().out.strip() == "--forward=-y --up=z"

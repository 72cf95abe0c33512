"""What `serial` says at a pseudo-terminal: every anchor by its name, and a true sentence for what it cannot use."""

import re
import time
from pathlib import Path
from subprocess import Popen

import pytest

from dropanchor_schemas.wire import anchor_number
from support import module_strings as said
from support.commands import start_python
from support.listening import listening
from support.patience import PATIENCE_S
from support.pattern_strings import DW1000, QM33
from support.serial_module import Answer, plugged_in, talkative
from support.zenoh_router import wait_until


def witmotion() -> bytes:
    """Return a frame with accelerations and one with turn rates."""
    frames = (bytes([0x55, kind, *range(8)]) for kind in (0x51, 0x52))
    return b"".join(frame + bytes([sum(frame) & 0xFF]) for frame in frames)


UNKNOWN = "RNG peer 0x12 dist 1234 mm q=9"


def heard(
    endpoint: str,
    folder: Path,
    answer: Answer,
    sentence: str,
    *options: str,
    baud: int = 115_200,
) -> str:
    """Run the command at a module until it says something, and return all that it said."""
    with plugged_in(folder / "port", answer, baud, period_s=0.1) as module:
        command = ("-m", "dropanchor_tag_client", "serial", str(module.path), "--tag", "a", "--connect", endpoint)
        process = start_python(*command, *options)
        try:
            text = read_until(process, sentence)
        finally:
            process.terminate()
            rest = process.communicate(timeout=PATIENCE_S)[1]
    return text + rest


def read_until(process: "Popen[str]", sentence: str) -> str:
    errors, text, end_s = process.stderr, "", time.monotonic() + PATIENCE_S
    assert errors is not None
    while sentence not in text:
        assert time.monotonic() < end_s, text
        line = errors.readline()
        assert line, text
        text += line
    return text


def test_all_anchors_of_a_line_are_named(router_endpoint: str, tmp_path: Path) -> None:
    text = heard(router_endpoint, tmp_path, talkative(said.LEC), '"15BA"')
    assert re.findall(r'anchor "(\w+)"', text) == ["022E", "9280", "DCAE", "15BA"]


def test_a_module_that_reports_no_anchor_is_said_to_hear_none(router_endpoint: str, tmp_path: Path) -> None:
    text = heard(router_endpoint, tmp_path, talkative("DIST,0"), "hears no anchor", "--module", "dwm1001")
    assert "left out" not in text


def test_an_overflow_is_not_a_distance_and_no_matter_of_calibration(router_endpoint: str, tmp_path: Path) -> None:
    overflow = said.LEC_ONE.replace("0.79", "-4480.12")
    text = heard(router_endpoint, tmp_path, talkative(overflow), "not a distance")
    assert "antenna delay" not in text
    assert "hears no anchor" not in text


def test_a_line_that_nobody_knows_is_shown_with_the_pattern_to_try(router_endpoint: str, tmp_path: Path) -> None:
    text = heard(router_endpoint, tmp_path, talkative(f"\x07{UNKNOWN}"), "try: --pattern")
    assert f'"\\x07{UNKNOWN}"' in text
    assert "--pattern 'peer {anchor} dist {range:mm} mm'" in text


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        (said.LEP, "A dwm1001 prints positions so (lep). Ranges are needed: type `lec`, or --module dwm1001."),
        ("DIST,0", "dwm1001 prints such lines; these hold no distance. Is it set up as a tag, and is an anchor on?"),
        ("$1782,3.21", "linorobot prints such lines, and other boards do, too: --module linorobot if it is one."),
        (witmotion(), "it looks like a WitMotion sensor in its binary protocol: an IMU"),
        ("$GPGGA,,,,,,0,,,,,,,,*66", "it looks like a GNSS receiver (NMEA)"),
    ],
)
def test_what_is_not_enough_to_be_a_module_is_called_by_its_name(
    router_endpoint: str, tmp_path: Path, line: str | bytes, sentence: str
) -> None:
    assert sentence in heard(router_endpoint, tmp_path, talkative(line), "no module recognised yet")


@pytest.mark.parametrize("period_s", [0.05, 3.0])
def test_a_board_that_talks_is_not_taken_for_a_module_nor_written_to(
    router_endpoint: str, tmp_path: Path, period_s: float
) -> None:
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative("Distance: 312"), period_s=period_s) as module,
    ):
        command = (
            "-m",
            "dropanchor_tag_client",
            "serial",
            str(module.path),
            "--tag",
            "a",
            "--connect",
            router_endpoint,
        )
        process = start_python(*command)
        try:
            for _ in range(2):
                read_until(process, "try: --pattern 'Distance: {range:cm}' (the line does not say its unit")
        finally:
            process.terminate()
            process.communicate(timeout=PATIENCE_S)
    assert not received.frames
    assert module.written == b""


def test_a_line_without_a_range_is_shown_with_both_ways_out(router_endpoint: str, tmp_path: Path) -> None:
    text = heard(router_endpoint, tmp_path, talkative("hello " * 40), "`publish`")
    assert "--pattern describes" in text
    assert max(len(part) for part in re.findall(r'"(hello[^"]*)"', text)) == 121


def test_the_suggested_pattern_gives_ranges(router_endpoint: str, tmp_path: Path) -> None:
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(UNKNOWN)) as module,
    ):
        options = ("--pattern", "peer {anchor} dist {range:mm} mm", "--tag", "a", "--connect", router_endpoint)
        process = start_python("-m", "dropanchor_tag_client", "serial", str(module.path), *options)
        wait_until(lambda: len(received.ranges()) >= 5)
        process.terminate()
        process.communicate(timeout=PATIENCE_S)
    assert received.ranges() == pytest.approx([1.234] * len(received.ranges()))
    assert {one.anchor for frame in received.frames for one in frame.ranges} == {anchor_number("0x12")}


@pytest.mark.parametrize(("named", "text", "right"), [("dwm3001", QM33, "qm33-json"), ("trek1000", DW1000, "dw1000")])
def test_the_module_that_understands_is_used_instead_of_the_one_that_was_named(
    router_endpoint: str, tmp_path: Path, named: str, text: str, right: str
) -> None:
    errors = heard(router_endpoint, tmp_path, talkative(text), 'anchor "', "--module", named)
    assert f"{named} understands nothing here, {right} does: using it." in errors
    assert "reports nothing" not in errors


@pytest.mark.parametrize(
    ("answer", "baud", "sentence"),
    [
        (talkative(DW1000), 921_600, "no text: "),
        (talkative(bytes(range(128, 256))), 115_200, "Another --baud than 115200 may be right"),
        (talkative(b"Range 3.2 m "), 115_200, "no end of a line: "),
        (lambda _: b"", 115_200, "dw1000 reports nothing. Is an anchor on?"),
    ],
)
def test_what_is_no_line_of_text_is_explained(
    router_endpoint: str, tmp_path: Path, answer: Answer, baud: int, sentence: str
) -> None:
    text = heard(router_endpoint, tmp_path, answer, sentence, "--module", "dw1000", baud=baud)
    assert ("reports nothing" in text) == ("reports nothing" in sentence)


def test_a_module_in_a_file_is_used_with_its_baud_rate(router_endpoint: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('baud = 921600\npatterns = ["peer {anchor} dist {range:mm} mm"]\n')
    text = heard(router_endpoint, tmp_path, talkative(UNKNOWN), 'anchor "', "--module", str(file), baud=921_600)
    assert 'anchor "0x12"' in text


def test_an_imu_line_beside_a_range_line_is_published_in_si_units(router_endpoint: str, tmp_path: Path) -> None:
    lines = ("r 7 2.50 0.1 1000", "i 1.0 0.0 0.0 180 0 0 20 0 -40 1010")
    patterns = (
        "r {anchor} {range:m} {std:m} {t:ms}",
        "i {ax:g} {ay:g} {az:g} {gx:deg/s} {gy:deg/s} {gz:deg/s} {mx:uT} {my:uT} {mz:uT} {t:ms}",
    )
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(*lines)) as module,
    ):
        options = [word for text in patterns for word in ("--pattern", text)]
        command = ("serial", str(module.path), "--tag", "a", "--connect", router_endpoint, "--forward", "y", *options)
        process = start_python("-m", "dropanchor_tag_client", *command)
        wait_until(lambda: any(frame.imu for frame in received.frames) and len(received.ranges()) > 0)
        process.terminate()
        process.communicate(timeout=PATIENCE_S)
    (imu, *_) = [sample for frame in received.frames for sample in frame.imu]
    assert imu.acc == pytest.approx((0.0, -9.80665, 0.0), abs=1e-5)
    assert imu.gyro == pytest.approx((0.0, -3.14159, 0.0), abs=1e-5)
    assert imu.mag == pytest.approx((0.0, -20.0, -40.0), abs=1e-4)
    (one, *_) = [sample for frame in received.frames for sample in frame.ranges]
    assert (one.anchor, one.range_m, round(one.std_m, 6)) == (7, 2.5, 0.1)

"""Modules at a real pseudo-terminal, at their baud rates: what they print is published, whatever happens."""

import re
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dropanchor_schemas.wire import anchor_number
from dropanchor_tag_client.cli import main
from support import module_strings as said
from support.commands import start_python
from support.listening import ReceivedFrames, listening
from support.serial_module import Answer, SerialModule, dwm1001_shell, plugged_in, talkative, woken_by
from support.zenoh_router import wait_until

Pairs = list[tuple[int | str, float]]

MODULES: list[tuple[str, Callable[[], Answer], Pairs]] = [
    ("dwm1001", lambda: talkative(said.LEC), [*said.LEC_RANGES]),
    ("dwm1001", lambda: dwm1001_shell(said.LEC), [*said.LEC_RANGES]),
    ("dwm1001", lambda: talkative(said.LES), [*said.LES_RANGES]),
    ("dwm3001", lambda: talkative(said.NOTIFICATION_TWO_LINES), [(1, 2.10)]),
    ("trek1000", lambda: talkative(said.TREK_MR, said.TREK_MC, said.TREK_MA), [*said.TREK_MC_RANGES]),
    ("trek1000", lambda: woken_by(b"deca$", said.TREK_CLONE, echo="n"), [(2, 8.5), (3, 1.5)]),
    ("makerfabs", lambda: woken_by(b"AT+SETRPT=1\r\n", said.MAKERFABS), [(2, 0.3)]),
    ("linktrack", lambda: talkative(said.NODEFRAME2), [*said.NODEFRAME2_RANGES]),
    ("linktrack", lambda: talkative(said.NODEFRAME3), [*said.NODEFRAME3_RANGES]),
]


@contextmanager
def serial(endpoint: str, module: SerialModule, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """`dropanchor-tag serial`, ended at the end."""
    process = start_python(
        *("-m", "dropanchor_tag_client", "serial", str(module.path), "--connect", endpoint), *arguments
    )
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=30)


def ranges(heard: ReceivedFrames) -> list[tuple[int, float]]:
    return [(one.anchor, round(one.range_m, 3)) for frame in heard.frames for one in frame.ranges]


def hear_more(heard: ReceivedFrames) -> None:
    before = len(heard.ranges())
    wait_until(lambda: len(heard.ranges()) >= before + 5)


def numbered(pairs: Pairs) -> list[tuple[int, float]]:
    return [(anchor_number(anchor), range_m) for anchor, range_m in pairs]


@pytest.mark.parametrize(("name", "answer", "expected"), MODULES)
@pytest.mark.parametrize("chosen", ["named", "auto"])
def test_what_a_module_prints_is_published(
    router_endpoint: str,
    tmp_path: Path,
    name: str,
    answer: Callable[[], Answer],
    expected: Pairs,
    chosen: str,
) -> None:
    module_name = name if chosen == "named" else "auto"
    baud = 921_600 if name == "linktrack" else 115_200
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", answer(), baud) as module,
        serial(router_endpoint, module, "--tag", "a", "--module", module_name),
    ):
        wait_until(lambda: len(heard.ranges()) >= 5 * len(expected))
        found = ranges(heard)
    assert found[: 2 * len(expected)] == 2 * numbered(expected)


def test_a_dwm1001_that_reports_already_is_not_written_to(router_endpoint: str, tmp_path: Path) -> None:
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", talkative(said.LEC)) as module,
        serial(router_endpoint, module, "--tag", "a"),
    ):
        wait_until(lambda: len(heard.ranges()) >= 300)  # for longer than the patience with a silent module
    assert module.heard == b""


def test_a_module_that_is_unplugged_goes_on_when_it_comes_back(router_endpoint: str, tmp_path: Path) -> None:
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", dwm1001_shell(said.LEC_ONE)) as module,
        serial(router_endpoint, module, "--tag", "a", "--module", "dwm1001") as process,
    ):
        for _ in range(2):
            hear_more(heard)
            module.unplug()
            time.sleep(1.0)  # longer than the first attempts to open it
            assert process.poll() is None
            module.plug(dwm1001_shell(said.LEC_ONE))  # it had no power: it is silent again
        hear_more(heard)


def test_nonsense_ends_nothing_and_is_told_at_most_once_per_second(router_endpoint: str, tmp_path: Path) -> None:
    nonsense: list[str | bytes] = [
        bytes(range(256)),
        said.LEC_DAMAGED,
        said.NOTIFICATION_NEGATIVE,
        said.LEP,
        b"mc \r\nAT+RANGE=\r\n" * 20,
    ]
    began = time.monotonic()
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", talkative(*nonsense, said.LEC_ONE), period_s=0.01) as module,
        serial(router_endpoint, module, "--tag", "a", "--module", "dwm1001") as process,
    ):
        wait_until(lambda: len(heard.ranges()) >= 50)
        assert process.poll() is None
        took_s = time.monotonic() - began
        process.terminate()
        _, errors = process.communicate(timeout=30)
    lines = errors.splitlines()
    assert 2 <= len(lines) <= took_s + 2
    assert any("left out" in line and "damaged" in line for line in lines)
    assert re.search(r"\d+ ranges and 0 IMU samples published; left out: damaged \d+", lines[-1])


def test_an_anchor_publishes_each_of_its_tags_under_its_own_key(router_endpoint: str, tmp_path: Path) -> None:
    texts = [said.TREK_MC.replace("a0:0", f"a{tag}:0") for tag in range(3)]
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", talkative(*texts), period_s=0.01) as module,
        serial(router_endpoint, module, "--module", "trek1000", "--tag-from-id", "--tag", "cart-"),
    ):
        wait_until(lambda: len(set(heard.keys)) == 3 and len(heard.ranges()) > 60)
    assert {key.split("/")[-2] for key in heard.keys} == {"cart-0", "cart-1", "cart-2"}


def test_a_module_that_is_the_anchor_itself_names_tags(router_endpoint: str, tmp_path: Path) -> None:
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", talkative(said.NOTIFICATION_FOUR)) as module,
        serial(router_endpoint, module, "--module", "dwm3001", "--tag-from-id", "--as-anchor", "7"),
    ):
        wait_until(lambda: len(set(heard.keys)) == 3)
    assert {key.split("/")[-2] for key in heard.keys} == {"1", "2", "4"}
    assert {anchor for anchor, _ in ranges(heard)} == {7}


def test_without_the_option_the_ranges_of_a_second_tag_are_left_out(router_endpoint: str, tmp_path: Path) -> None:
    other = said.TREK_MC.replace("a0:0", "a1:0").replace("00000663", "00001000")
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", talkative(said.TREK_MC, other), period_s=0.01) as module,
        serial(router_endpoint, module, "--module", "trek1000", "--tag", "a"),
    ):
        wait_until(lambda: len(heard.ranges()) > 60)
    assert len(set(heard.ranges())) == 4


def test_anchors_get_the_names_of_the_site(router_endpoint: str, tmp_path: Path) -> None:
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", talkative(said.LEC)) as module,
        serial(router_endpoint, module, "--tag", "a", "--name", "022E=yard", "--name", "9280=7"),
    ):
        wait_until(lambda: len(heard.ranges()) >= 4)
    assert {anchor for anchor, _ in ranges(heard)} >= {anchor_number("yard"), 7}


def test_an_imu_is_published_in_the_axes_of_the_tag_and_told_when_they_are_wrong(
    router_endpoint: str, tmp_path: Path
) -> None:
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", talkative(said.NODEFRAME2), 921_600, period_s=0.01) as module,
    ):
        options = ("--tag", "a", "--module", "linktrack")
        with serial(router_endpoint, module, *options) as process:
            errors = process.stderr
            assert errors is not None
            wait_until(lambda: "start again with --up=y" in errors.readline())
        heard.frames.clear()
        with serial(router_endpoint, module, *options, "--up", "y"):
            wait_until(lambda: any(frame.imu for frame in heard.frames))
        acc = [sample.acc for frame in heard.frames for sample in frame.imu][-1]
    assert acc == pytest.approx((0.22494, 0.05504, 9.73712), abs=1e-4)


def test_what_cannot_work_is_said_with_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, message in [
        (["serial", str(tmp_path / "none"), "--tag", "a"], "there is no serial port"),
        (["serial", str(tmp_path / "none")], "--tag says so"),
        (["serial", "x", "--tag", "a", "--name", "7"], "ID=NAME was expected"),
        (["serial", "x", "--tag", "a", "--as-anchor", "7"], "--as-anchor needs --tag-from-id"),
        (["serial", "x", "--tag", "a", "--up", "x"], "must be different axes"),
        (["serial", str(tmp_path), "--tag", "a"], "cannot be used at 115200 baud"),
    ]:
        assert main(arguments) == 2
        assert message in capsys.readouterr().err


def test_a_port_in_use_is_said(router_endpoint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (
        listening(router_endpoint) as heard,
        plugged_in(tmp_path / "port", talkative(said.LEC)) as module,
        serial(router_endpoint, module, "--tag", "a"),
    ):
        wait_until(lambda: heard.ranges())
        assert main(["serial", str(module.path), "--tag", "b"]) == 2
        assert "in use by another program" in capsys.readouterr().err

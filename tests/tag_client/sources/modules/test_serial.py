"""Modules at a real pseudo-terminal, at their baud rates: what they print is published, whatever happens."""

import math
import re
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dropanchor_schemas.wire import anchor_number
from dropanchor_tag_client.cli import main
from dropanchor_tag_client.sources.modules.catalogue import MODULES
from support import module_strings as said
from support.commands import start_python
from support.listening import ReceivedFrames, listening
from support.module_strings import EXAMPLES, Pairs
from support.patience import PATIENCE_S
from support.pattern_strings import PATTERN_EXAMPLES
from support.serial_module import Answer, SerialModule, dwm1001_shell, plugged_in, talkative
from support.zenoh_router import wait_until

BEHAVIOURS = [(name, *behaviour) for name, example in EXAMPLES.items() for behaviour in example.at_port]


@contextmanager
def serial(endpoint: str, module: SerialModule, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run `dropanchor-tag serial`, and end it at the end."""
    process = start_python(
        *("-m", "dropanchor_tag_client", "serial", str(module.path), "--connect", endpoint), *arguments
    )
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE_S)


def ranges(received: ReceivedFrames) -> list[tuple[int, float]]:
    return [(one.anchor, round(one.range_m, 3)) for frame in received.frames for one in frame.ranges]


def wait_for_more(received: ReceivedFrames) -> None:
    before = len(received.ranges())
    wait_until(lambda: len(received.ranges()) >= before + 5)


def numbered(pairs: Pairs) -> list[tuple[int, float]]:
    return [(anchor_number(anchor), range_m) for anchor, range_m in pairs]


@pytest.mark.parametrize(("name", "answer", "expected"), BEHAVIOURS)
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
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", answer(), MODULES[name].baud) as module,
        serial(router_endpoint, module, "--tag", "a", "--module", module_name),
    ):
        wait_until(lambda: len(received.ranges()) >= 5 * len(expected))
        found = ranges(received)
    assert found[: 2 * len(expected)] == 2 * numbered(expected)


@pytest.mark.parametrize("name", PATTERN_EXAMPLES)
def test_a_module_that_is_a_pattern_is_found_and_what_it_prints_is_published(
    router_endpoint: str, tmp_path: Path, name: str
) -> None:
    example = PATTERN_EXAMPLES[name]
    expected = numbered(example.documented[0][1])
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", example.answer(), MODULES[name].baud) as module,
        serial(router_endpoint, module, "--tag", "a", *example.options),
    ):
        wait_until(lambda: len(received.ranges()) >= 5)
        assert set(ranges(received)) == set(expected)


@pytest.mark.parametrize(
    ("name", "options", "degrees"),
    [("pdoa", [], -45.0), ("pdoa", ["--mirrored"], 45.0), ("qm33-json", ["--azimuth-std", "5"], 0.1)],
)
def test_what_an_anchor_measures_of_the_direction_of_a_tag_is_its_bearing(
    router_endpoint: str, tmp_path: Path, name: str, options: list[str], degrees: float
) -> None:
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", PATTERN_EXAMPLES[name].answer(), MODULES[name].baud) as module,
        serial(router_endpoint, module, "--module", name, "--tag-from-id", "--as-anchor", "7", *options),
    ):
        wait_until(lambda: len(received.ranges()) >= 5)
        bearing = next(one for frame in received.frames for one in frame.bearings)
    assert bearing.anchor == 7
    assert math.degrees(bearing.bearing_rad) == pytest.approx(degrees, abs=1e-3)
    assert math.degrees(bearing.std_rad) == pytest.approx(5.0 if "--azimuth-std" in options else 10.0, abs=1e-3)


def test_a_dwm1001_that_reports_already_is_not_written_to(router_endpoint: str, tmp_path: Path) -> None:
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(said.LEC)) as module,
        serial(router_endpoint, module, "--tag", "a"),
    ):
        wait_until(lambda: len(received.ranges()) >= 300)  # for longer than a module may be silent
    assert module.written == b""


def test_a_module_that_is_unplugged_goes_on_when_it_comes_back(router_endpoint: str, tmp_path: Path) -> None:
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", dwm1001_shell(said.LEC_ONE)) as module,
        serial(router_endpoint, module, "--tag", "a", "--module", "dwm1001") as process,
    ):
        for _ in range(2):
            wait_for_more(received)
            module.unplug()
            time.sleep(1.0)  # longer than the first attempts to open it
            assert process.poll() is None
            module.plug(dwm1001_shell(said.LEC_ONE))  # it had no power: it is silent again
        wait_for_more(received)


def test_nonsense_ends_nothing_and_is_logged_at_most_once_per_second(router_endpoint: str, tmp_path: Path) -> None:
    nonsense: list[str | bytes] = [
        bytes(range(256)),
        said.LEC_DAMAGED,
        said.NOTIFICATION_NEGATIVE,
        said.LEP,
        b"mc \r\nAT+RANGE=\r\n" * 20,
    ]
    began = time.monotonic()
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(*nonsense, said.LEC_ONE), period_s=0.01) as module,
        serial(router_endpoint, module, "--tag", "a", "--module", "dwm1001") as process,
    ):
        wait_until(lambda: len(received.ranges()) >= 50)
        assert process.poll() is None
        took_s = time.monotonic() - began
        process.terminate()
        _, errors = process.communicate(timeout=PATIENCE_S)
    lines = errors.splitlines()
    assert 2 <= len(lines) <= took_s + 2
    assert any("left out" in line and "damaged" in line for line in lines)
    assert re.search(r"\d+ ranges and 0 IMU samples published; left out: damaged \d+", lines[-1])


def test_an_anchor_publishes_each_of_its_tags_under_its_own_key(router_endpoint: str, tmp_path: Path) -> None:
    texts = [said.TREK_MC.replace("a0:0", f"a{tag}:0") for tag in range(3)]
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(*texts), period_s=0.01) as module,
        serial(router_endpoint, module, "--module", "trek1000", "--tag-from-id", "--tag", "cart-"),
    ):
        wait_until(lambda: len(set(received.keys)) == 3 and len(received.ranges()) > 60)
    assert {key.split("/")[-2] for key in received.keys} == {"cart-0", "cart-1", "cart-2"}


def test_a_module_that_is_the_anchor_itself_names_tags(router_endpoint: str, tmp_path: Path) -> None:
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(said.NOTIFICATION_FOUR)) as module,
        serial(router_endpoint, module, "--module", "dwm3001", "--tag-from-id", "--as-anchor", "7"),
    ):
        wait_until(lambda: len(set(received.keys)) == 3)
    assert {key.split("/")[-2] for key in received.keys} == {"1", "2", "4"}
    assert {anchor for anchor, _ in ranges(received)} == {7}


def test_without_the_option_the_ranges_of_a_second_tag_are_left_out(router_endpoint: str, tmp_path: Path) -> None:
    other = said.TREK_MC.replace("a0:0", "a1:0").replace("00000663", "00001000")
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(said.TREK_MC, other), period_s=0.01) as module,
        serial(router_endpoint, module, "--module", "trek1000", "--tag", "a"),
    ):
        wait_until(lambda: len(received.ranges()) > 60)
    assert len(set(received.ranges())) == 4


def test_anchors_get_the_names_of_the_site(router_endpoint: str, tmp_path: Path) -> None:
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(said.LEC)) as module,
        serial(router_endpoint, module, "--tag", "a", "--name", "022E=yard", "--name", "9280=7"),
    ):
        wait_until(lambda: len(received.ranges()) >= 4)
    assert {anchor for anchor, _ in ranges(received)} >= {anchor_number("yard"), 7}


def test_an_imu_is_published_in_the_axes_of_the_tag_with_a_hint_if_they_are_wrong(
    router_endpoint: str, tmp_path: Path
) -> None:
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(said.NODEFRAME2), 921_600, period_s=0.01) as module,
    ):
        with serial(router_endpoint, module, "--tag", "a", "--module", "linktrack") as process:
            errors = process.stderr
            assert errors is not None
            wait_until(lambda: "start again with --up=y" in errors.readline())
        with serial(router_endpoint, module, "--tag", "b", "--module", "linktrack", "--up", "y"):
            acc = wait_until(lambda: [one.acc for frame in received.of("b") for one in frame.imu])[0]
    assert acc == pytest.approx((0.22494, 0.05504, 9.73712), abs=1e-4)


def test_wrong_arguments_are_refused_with_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, message in [
        (["serial", str(tmp_path / "none"), "--tag", "a"], "there is no serial port"),
        (["serial", str(tmp_path / "none")], "--tag says so"),
        (["serial", "x", "--tag", "a", "--name", "7"], "ID=NAME was expected"),
        (["serial", "x", "--tag", "a", "--as-anchor", "7"], "--as-anchor needs --tag-from-id"),
        (["serial", "x", "--tag", "a", "--up", "x"], "must be different axes"),
        (["serial", str(tmp_path), "--tag", "a"], "cannot be used at 115200 baud"),
        (["serial", "x", "--tag", "a", "--module", "none.toml"], "none.toml cannot be read: No such file"),
        (["serial", "x", "--tag", "a", "--module", "bu01", "--pattern", "{range:m}"], "leave out --module"),
        (["serial", "x", "--tag", "a", "--pattern", "d={range:mile}"], 'no unit "mile"'),
    ]:
        assert main(arguments) == 2
        assert message in capsys.readouterr().err


def test_the_nearest_module_is_suggested_for_a_name_that_there_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    for name, message in [
        ("dwm101", "no module is called dwm101; did you mean dwm1001?"),
        ("?", "and files NAME.toml"),
    ]:
        with pytest.raises(SystemExit) as ended:
            main(["serial", "x", "--tag", "a", "--module", name])
        assert ended.value.code == 2
        assert message in capsys.readouterr().err


def test_a_port_in_use_is_reported(router_endpoint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (
        listening(router_endpoint) as received,
        plugged_in(tmp_path / "port", talkative(said.LEC)) as module,
        serial(router_endpoint, module, "--tag", "a"),
    ):
        wait_until(lambda: received.ranges())
        assert main(["serial", str(module.path), "--tag", "b"]) == 2
        assert "in use by another program" in capsys.readouterr().err

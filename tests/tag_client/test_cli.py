"""The command line: help with examples, clear errors, and a clean end on signals."""

import signal
from pathlib import Path

import pytest

from dropanchor_tag_client.cli import main
from support.commands import python, start_python
from support.listening import listening
from support.patience import PATIENCE_S
from support.zenoh_router import free_endpoint, wait_until

COMMAND = ("-m", "dropanchor_tag_client")


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    (tmp_path / "anchors.csv").write_text("id,x,y,z\n7,0,0,0\n")
    lines = "".join(f"{i / 10},7,{i}\n" for i in range(1000))
    (tmp_path / "range.csv").write_text("t_s,anchor_id,range_m\n" + lines)
    return tmp_path


@pytest.mark.parametrize(
    "command", [[], ["replay"], ["publish"], ["serial"], ["mqtt"], ["imu"], ["calibrate"], ["install"], ["simulate"]]
)
def test_the_help_has_examples(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main([*command, "--help"])
    assert end.value.code == 0
    assert "example" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["replay", "nowhere"], "nowhere is not a folder"),
        (["publish", "--tag", "", "--connect-timeout", "1"], "an id has 1 to 64 characters"),
        (["publish"], "--tag says so, or --credentials"),
        (["publish", "--credentials", "nowhere"], "nowhere holds no credentials of a tag"),
        (["publish", "--tag", "a", "--connect", "nonsense"], "an endpoint such as tcp/127.0.0.1:7447 was expected"),
        (["publish", "--tag", "a", "--cert", "x"], "cert and key go together"),
        (["publish", "--tag", "a", "--user", "x"], "DROPANCHOR_PASSWORD"),
        (["publish", "--tag", "a", "--connect", free_endpoint(), "--connect-timeout", "0.2"], "Cannot connect to"),
        (["publish", "--tag", "a", "--spool", "/proc/spool"], "the spool /proc/spool/default/a cannot be used"),
        (["publish", "--tag", "a", "--spool", "/tmp", "--clock", "boot"], "a spool needs clock='utc'"),
        (["mqtt", "localhost"], "add --decawave, --sensor-logger TOPIC or --template FILE"),
        (["mqtt", "ftp://localhost", "--decawave"], "mqtt://host:1883 or mqtts://host:8883 was expected"),
        (["mqtt", "mqtt://localhost:port", "--decawave"], "the broker is"),
        (["mqtt", "localhost", "--decawave", "--mqtt-ca", "x"], "not an mqtts:// or wss:// address"),
        (["mqtt", "mqtts://localhost", "--decawave", "--mqtt-ca", "nowhere"], "the certificates cannot be used"),
        (["mqtt", "localhost", "--decawave", "--mqtt-user", "x"], "DROPANCHOR_MQTT_PASSWORD"),
        (["mqtt", "localhost", "--decawave", "--name", "x"], "ID=NAME was expected"),
        (["mqtt", "localhost", "--template", "nowhere.toml"], "nowhere.toml"),
        (["mqtt", "localhost", "--sensor-logger", "phones/+x"], "--sensor-logger is 'phones/+x'"),
    ],
)
def test_an_error_prints_a_message_and_exits_with_code_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert "Traceback" not in errors


@pytest.mark.parametrize(
    "arguments",
    [[], ["dance"], ["replay"], ["replay", "x", "--speed", "-1"], ["replay", "x", "--speed", "fast"]],
)
def test_an_invalid_command_line_exits_with_code_2(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2


def test_a_missing_anchor_is_an_error_that_lists_the_anchors_of_the_recording(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(recording), "--anchor", "9"]) == 2
    assert "no anchor '9'; it has: 7" in capsys.readouterr().err


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_replay_quickly_and_buffered_samples_are_sent(
    router_endpoint: str, recording: Path, number: signal.Signals, code: int
) -> None:
    with listening(router_endpoint) as heard:
        process = start_python(*COMMAND, "replay", str(recording), "--connect", router_endpoint, "--loop")
        try:
            wait_until(lambda: len(heard.ranges()) >= 3)
            process.send_signal(number)
            process.wait(PATIENCE_S)
        finally:
            process.kill()
            _, errors = process.communicate()
    assert process.returncode == code
    assert "Traceback" not in errors
    assert heard.ranges() == [float(i) for i in range(len(heard.ranges()))]


def test_ctrl_c_ends_a_client_that_is_still_connecting(recording: Path) -> None:
    endpoint = free_endpoint()
    process = start_python(*COMMAND, "replay", str(recording), "--connect", endpoint)
    try:
        assert process.stderr is not None
        assert f"Cannot connect to {endpoint}" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == -signal.SIGINT
    finally:
        process.kill()
        process.communicate()


def test_a_replay_reports_how_much_it_sent(router_endpoint: str, recording: Path) -> None:
    with listening(router_endpoint):
        done = python(*COMMAND, "replay", str(recording), "--connect", router_endpoint, "--speed", "0")
    assert done.returncode == 0
    assert "1000 samples of" in done.stderr

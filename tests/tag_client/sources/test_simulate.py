"""dropanchor-tag simulate: tags heard over a real router, and recordings."""

import math
import signal
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from dropanchor_schemas.keys import tag_from_key
from dropanchor_schemas.wire import anchor_number
from dropanchor_tag_client.cli import main
from dropanchor_tag_client.recording import read_recording
from dropanchor_tag_client.simulator.live import start_poses
from support.commands import python, start_python
from support.listening import ReceivedFrames, listening
from support.patience import PATIENCE_S
from support.zenoh_router import free_endpoint, running_router, wait_until

COMMAND = ("-m", "dropanchor_tag_client", "simulate")


def tags_of(heard: ReceivedFrames) -> Counter[str]:
    return Counter(map(tag_from_key, heard.keys))


def test_simulated_tags_are_heard_at_their_start_poses() -> None:
    endpoint = free_endpoint()
    with running_router(endpoint), listening(endpoint) as heard:
        options = ("--tags", "3", "--seed", "5", "--anchor", "A1", "--noise", "none", "--range-hz", "10")
        done = python(*COMMAND, *options, "--duration", "1.5", "--connect", endpoint)
        assert done.returncode == 0, done.stderr
        wait_until(lambda: sum(len(frame.imu) for frame in heard.frames) >= 450)
    assert set(tags_of(heard)) == {"sim-1", "sim-2", "sim-3"}
    for index, pose in enumerate(start_poses(3, 5)):
        frames = [f for f, key in zip(heard.frames, heard.keys, strict=True) if tag_from_key(key) == f"sim-{index + 1}"]
        ranges = [sample for frame in frames for sample in frame.ranges]
        assert {sample.anchor for sample in ranges} == {anchor_number("A1")}
        assert [s.range_m for s in ranges] == pytest.approx([math.hypot(pose.x, pose.y)] * len(ranges), rel=1e-6)
        assert len(ranges) == 15
        assert np.diff([s.t_ns for f in frames for s in f.imu]) == pytest.approx(1e7, abs=1001)
        assert [frame.sequence for frame in frames] == list(range(len(frames)))


def test_ctrl_c_ends_it_at_once() -> None:
    endpoint = free_endpoint()
    with running_router(endpoint), listening(endpoint) as heard:
        process = start_python(*COMMAND, "--tags", "2", "--connect", endpoint)
        try:
            wait_until(lambda: len(tags_of(heard)) == 2)
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE_S) == 130
        finally:
            process.kill()
            _, said = process.communicate()
    assert said == f"scenario yard, sim-1, sim-2 to {endpoint}; Ctrl-C ends\n"


def test_out_writes_recordings_that_the_reader_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["simulate", "--out", str(tmp_path), "--tags", "2", "--scenario", "M5", "--duration", "30"]
    assert main([*arguments, "--anchor", "L0"]) == 0
    for name in ("sim-1", "sim-2"):
        recording = read_recording(tmp_path / name)
        assert [anchor.id for anchor in recording.anchors] == ["L0"]
        assert len(recording.ranges["t_s"]) == 301
        assert len(recording.imu["mx"]) == len(recording.truth["t_s"]) == len(recording.headings["yaw_rad"]) == 3001
        x, y = (np.asarray(recording.truth[name])[::10] for name in "xy")
        errors = np.asarray(recording.ranges["range_m"]) - np.hypot(x, y)
        assert errors.std() == pytest.approx(0.1, rel=0.2)
    assert "sim-2: 30 s, 301 ranges" in capsys.readouterr().err


def test_one_tag_is_written_into_the_folder_itself(tmp_path: Path) -> None:
    assert main(["simulate", "--out", str(tmp_path / "yard"), "--duration", "5", "--perturb", "nlos10"]) == 0
    assert read_recording(tmp_path / "yard").name == "yard"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--perturb", "late15", "--out", "x", "--scenario", "S5", "--duration", "3"], "there are no samples"),
        (["--duration", "0.001", "--out", "x"], "shorter than the time between two IMU samples"),
        (["--seed", "-1", "--out", "x"], "non-negative"),
    ],
)
def test_what_cannot_be_simulated_ends_with_a_sentence(
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    "arguments", [["--tags", "0"], ["--duration", "-1"], ["--scenario", "S6"], ["--range-hz", "x"]]
)
def test_options_that_make_no_sense_end_with_code_2(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["simulate", *arguments])
    assert end.value.code == 2

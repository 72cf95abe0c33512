"""A replay of the files that a service records gives the poses that the service gave."""

import csv
import time
from functools import partial
from pathlib import Path

import httpx
import pytest
import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, encode_json, encode_packed
from dropanchor_service.cli import main
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.recording.mcap_file import McapFile
from dropanchor_service.recording.reading import RecordingReader
from dropanchor_service.settings.sources import load_settings
from dropanchor_tag_client.recording import RecordingError
from support.patience import PATIENCE_S
from support.service import running_service, settings_file, straight_north
from support.zenoh_router import connected_session, wait_until

S = 1_000_000_000


def on_disk(folder: Path) -> tuple[int, int]:
    """Return how many messages and poses are in the recording so far, of which a kill leaves whole chunks."""
    try:
        turns = [turn for file in folder.glob("*.mcap") for turn in RecordingReader(file).turns()]
    except RecordingError:  # not even its header is on the disk yet
        return 0, 0
    return sum(len(turn.messages) for turn in turns), sum(len(turn.estimates) for turn in turns)


@pytest.mark.parametrize("engine", ["paper", "fleet"])
def test_a_replayed_recording_gives_the_live_poses_even_after_a_kill(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], engine: str
) -> None:
    config = settings_file(
        tmp_path, ["a", "b"], f'engine = "{engine}"\n[recording]\nenabled = true\npose_period_s = 0.01'
    )
    options = ["--config", str(config), "--data-dir", str(tmp_path)]
    create_engine(load_settings(config, environment={}))  # compiles the kernels before the service starts
    end_ns = time.time_ns() - 20 * S  # times of a clock that is ahead would be mapped
    with running_service(*options) as service, connected_session(service.zenoh) as session:
        for step in range(10):
            frame = straight_north(20, end_ns + step * 2 * S, speed_mps=0.5)
            # A put that may be dropped is dropped on a busy machine after a millisecond.
            put = partial(session.put, congestion_control=zenoh.CongestionControl.BLOCK)
            put(keys.samples_key("default", "a"), encode_packed(frame), encoding=ENCODING_PACKED)
            put(keys.samples_key("default", "b"), encode_json(frame), encoding=ENCODING_JSON)
        wait_until(lambda: service.metric("dropanchor_poses_total") >= 380)
        live = service.get("/api/v1/poses")["poses"]
        httpx.put(f"{service.url}/api/v1/tags/a/settings", json={}).raise_for_status()
        wait_until(lambda: service.metric("dropanchor_recording_messages_total") >= 400)
        wait_until(lambda: on_disk(tmp_path / "recordings") >= (20, 380))
        service.process.kill()
        service.process.wait(PATIENCE_S)
    assert main(["replay", str(tmp_path / "recordings"), "--out", str(tmp_path / "poses.csv")]) == 0
    output = capsys.readouterr()
    assert "is truncated" in output.err
    words = output.out.split("recorded poses: ")[1].split()
    assert words[0] == words[2]
    assert int(words[0]) >= 380
    with (tmp_path / "poses.csv").open(newline="") as file:
        rows = {(row["tag"], int(row["t_ns"])): row for row in csv.DictReader(file)}
    for pose in live:
        row = rows[pose["tag"], pose["t_ns"]]
        assert row["state"] == pose["state"] or pose["state"] in ("coasting", "lost")
        if pose["x"] is not None:
            assert (float(row["x"]), float(row["y"])) == pytest.approx((pose["x"], pose["y"]), abs=1e-6)


def test_a_recording_that_starts_midway_is_compared_where_both_runs_have_a_position(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = settings_file(tmp_path, [], "[recording]\npose_period_s = 0.01")
    end_ns = time.time_ns() - 20 * S
    with (
        running_service("--config", str(config), "--data-dir", str(tmp_path)) as service,
        connected_session(service.zenoh) as session,
    ):

        def send(step: int) -> None:
            frame = straight_north(20, end_ns + step * 2 * S, speed_mps=0.5)
            session.put(keys.samples_key("default", "a"), encode_packed(frame), encoding=ENCODING_PACKED)
            wait_until(lambda: service.metric("dropanchor_poses_total") >= 18 * (step + 1))

        for step in range(5):
            send(step)
        httpx.post(f"{service.url}/api/v1/recordings", json={"tags": None}).raise_for_status()
        for step in range(5, 10):
            send(step)
        assert service.stop() == 0
    assert main(["replay", str(tmp_path / "recordings")]) == 0
    output = capsys.readouterr().out
    assert "inf" not in output.replace("information", "")
    assert "not compared, because only the recording or only the replay has a position" in output


def test_options_that_an_mcap_recording_contains_itself_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    McapFile(tmp_path / "x.mcap", {}).finish()
    for option in ("--start=1,2", "--clock-offset=1"):
        assert main(["replay", str(tmp_path / "x.mcap"), option]) == 2
        assert option.partition("=")[0] in capsys.readouterr().err
    assert main(["replay", str(tmp_path / "x.mcap")]) == 2
    assert "is empty" in capsys.readouterr().err

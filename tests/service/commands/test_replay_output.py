"""The poses of a replay as CSV, JSON lines or Parquet, each with its frame, and a summary that tells frames apart."""

import gzip
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from dropanchor_service.commands.replay_report import report, score_of
from dropanchor_service.estimation.columns import POSE, Frame, SampleBatch, State
from dropanchor_service.offline.accuracy import Truth
from dropanchor_service.offline.replay import Samples, Track
from service.commands.replays import call, read_rows
from support.commands import environment
from support.recordings import write_square

ANCHOR = (2.0, -3.0)


def test_all_formats_hold_the_same_poses(tmp_path: Path) -> None:
    folder = write_square(tmp_path, 0.05)
    for ending in ("csv", "csv.gz", "jsonl", "jsonl.gz", "parquet"):
        assert call(folder, "--anchor=A", "--out", tmp_path / f"poses.{ending}").status == 0
    rows = read_rows(tmp_path / "poses.csv")
    assert {row["frame"] for row in rows} <= {"site", "relative"}
    assert {row["state"] for row in rows if row["frame"] == "relative"} <= {"initialising", "ambiguous", "relative"}
    assert "relative" not in {row["state"] for row in rows if row["frame"] == "site"}
    assert gzip.decompress((tmp_path / "poses.csv.gz").read_bytes()) == (tmp_path / "poses.csv").read_bytes()
    lines = [json.loads(line) for line in (tmp_path / "poses.jsonl").read_text().splitlines()]
    assert gzip.decompress((tmp_path / "poses.jsonl.gz").read_bytes()) == (tmp_path / "poses.jsonl").read_bytes()
    assert pq.read_table(tmp_path / "poses.parquet").to_pylist() == lines
    assert list(lines[0]) == list(rows[0])
    for line, row in zip(lines, rows, strict=True):
        for name, value in line.items():
            assert row[name] == ("" if value is None else value if isinstance(value, str) else f"{value:.6f}")


@pytest.mark.parametrize(
    ("out", "message"),
    [("poses.xlsx", "the name must end in .csv, "), ("nowhere/poses.csv", "in a folder that exists"), (".", "name of")],
)
def test_a_file_that_cannot_be_written_is_an_error_before_the_engine_runs(
    tmp_path: Path, out: str, message: str
) -> None:
    ended = call(write_square(tmp_path), "--anchor=A", "--out", tmp_path / out)
    assert ended.status == 2
    assert message in ended.error
    assert "engine" not in ended.out


def test_each_pose_has_its_height_and_where_it_comes_from(tmp_path: Path) -> None:
    assert call(write_square(tmp_path), "--anchor=A", "--tag-height=1.25", "--out", tmp_path / "poses.csv").status == 0
    last = read_rows(tmp_path / "poses.csv")[-1]
    assert (last["z"], last["z_source"]) == ("1.250000", "told")
    assert float(last["z_std"]) >= 0.0


def test_there_is_no_progress_bar_where_nobody_watches(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dropanchor_service", "replay", str(write_square(tmp_path)), "--anchor=A"]
    ended = subprocess.run(command, capture_output=True, text=True, env=os.environ | environment(), check=True)
    assert ended.stderr == ""


def circle(frames: list[Frame], turned: float) -> tuple[Track, Truth]:
    """Return a track round the anchor whose poses in the frame of the tag's own are turned about it."""
    t = np.arange(len(frames), dtype=float)
    angle, own = t / 10, np.array(frames) == Frame.RELATIVE
    truth = Truth(t, ANCHOR[0] + 10 * np.cos(angle), ANCHOR[1] + 10 * np.sin(angle))
    poses = np.zeros(len(t), POSE)
    shown = angle + turned * own
    poses["x"], poses["y"] = ANCHOR[0] + 10 * np.cos(shown), ANCHOR[1] + 10 * np.sin(shown)
    poses["frame"], poses["state"], poses["cov"] = frames, State.TRACKING, np.eye(3)
    return Track(t, poses), truth


def lines(frames: list[Frame]) -> list[str]:
    track, truth = circle(frames, turned=1.0)
    return list(report(track, score_of(track, truth, ANCHOR), Samples(SampleBatch(), Counter()), start_is_given=True))


def test_poses_in_a_frame_of_the_tags_own_are_scored_apart() -> None:
    said = lines([Frame.SITE] * 30 + [Frame.RELATIVE] * 20)
    assert "time: tracking 61.2%, relative 38.8%" in said
    assert said[0].startswith("RMSE 0.000 m")
    assert said[0].endswith("over 30 poses in the frame of the site")
    assert said[3] == (
        "RMSE 0.000 m after the best rotation about the anchor over 20 poses in a frame of the tag's own: its angle to "
        "the site's frame is not known"
    )


def test_a_track_without_a_pose_in_the_frame_of_the_site_has_no_plain_error() -> None:
    said = lines([Frame.RELATIVE] * 20)
    assert [line for line in said if line.startswith("RMSE")] == [said[0]]
    assert "after the best rotation about the anchor over 20 poses" in said[0]

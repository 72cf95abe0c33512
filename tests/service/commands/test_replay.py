"""`dropanchor replay` as a user calls it."""

import argparse
import csv
import math
from pathlib import Path

import pytest

from dropanchor_service.cli import main
from dropanchor_service.commands import replay
from dropanchor_tag_client.simulator.recording import write_recording
from service.commands.replays import yard
from support.recordings import recording_or_skip, write_square


def call(*arguments: str | Path) -> int:
    parser = argparse.ArgumentParser()
    replay.add_arguments(parser)
    return replay.run(parser.parse_args([str(argument) for argument in arguments]))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_recording_with_a_known_start_is_tracked_and_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_square(tmp_path, range_std_m=0.05)
    out, picture = tmp_path / "poses.csv", tmp_path / "track.png"
    status = call(folder, "--anchor", "A", "--engine", "paper", "--start=10,0,1.5708", "--out", out, "--plot", picture)
    printed = capsys.readouterr().out
    assert status == 0
    assert float(printed.split("RMSE ")[1].split()[0]) < 2.0
    assert "truth inside the 95 % ellipse" in printed
    assert picture.read_bytes().startswith(b"\x89PNG")
    poses = rows(out)
    assert list(poses[0]) == list(replay.COLUMNS)
    assert len(poses) == 600
    assert poses[300]["state"] in {"tracking", "degraded", "coasting"}


def test_the_default_engine_is_fleet_which_needs_no_start(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "poses.csv"
    assert call(write_square(tmp_path, range_std_m=0.05), "--anchor", "A", "--out", out) == 0
    printed = capsys.readouterr()
    assert "engine fleet on" in printed.out
    assert printed.err == ""  # a progress bar is for terminals only
    assert math.isfinite(float(rows(out)[-1]["x"]))


def test_a_truth_needs_no_heading_and_no_height(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, errors = write_square(tmp_path, range_std_m=0.05), []
    for columns in (("t_s", "x", "y", "z", "yaw_rad"), ("t_s", "x", "y")):
        true = rows(folder / "truth.csv")
        with (folder / "truth.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, columns, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(true)
        assert call(folder, "--anchor", "A", "--start=10,0,1.5708") == 0
        errors.append(capsys.readouterr().out.partition("RMSE ")[2])
    assert errors[0]
    assert errors[0] == errors[1]


@pytest.mark.parametrize(
    ("option", "told", "other"),
    [
        ("--motion=carried", '[tag_defaults]\nmotion = "carried"', '[tag_defaults]\nmotion = "vehicle"'),
        ("--height-motion=free", '[tag_defaults]\nheight_motion = "free"', '[tag_defaults]\nheight_motion = "flat"'),
        ("--declination=0.5", "[site]\ndeclination_rad = 0.5", "[site]\ndeclination_rad = -0.5"),
        ("--start=10,0", "[tag_defaults]\nstart = { x = 10.0, y = 0.0 }", "tag_defaults.start = { x = 4, y = 4 }"),
    ],
)
def test_a_settings_file_says_what_options_say_of_a_tag_and_an_option_wins(
    tmp_path: Path, option: str, told: str, other: str
) -> None:
    def poses(*options: str | Path) -> str:
        assert call(folder, *options, "--out", tmp_path / "poses.csv") == 0
        return (tmp_path / "poses.csv").read_text()

    folder = tmp_path / "drive"
    write_recording(yard(30.0), folder)
    for name, text in (("told", told), ("other", other)):
        (tmp_path / f"{name}.toml").write_text(text)
    by_option = poses(option)
    assert by_option == poses("--config", tmp_path / "told.toml")
    assert by_option == poses("--config", tmp_path / "other.toml", option)
    assert by_option != poses("--config", tmp_path / "other.toml")


def test_no_picture_is_written_without_the_option(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert call(write_square(tmp_path), "--anchor", "A", "--engine", "paper", "--start=10,0,1.5708") == 0
    assert list(Path.cwd().iterdir()) == []


def test_without_a_start_the_engine_paper_asks_for_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(write_square(tmp_path), "--anchor", "A", "--engine", "paper") == 0
    printed = capsys.readouterr().out
    assert "give --start X,Y,HEADING" in printed
    assert "ambiguous" in printed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--anchor", "Z"], "has no anchor 'Z'; it has: A, B"),
        ([], "has several anchors, choose one with --anchor: A, B"),
        (["--anchor", "B"], "has no usable range to this anchor"),
        (["--anchor", "A", "--range-scale", "0"], "range_scale: Input should be greater than 0"),
        (["--anchor", "A", "--engine", "nonsense"], "engine"),
        (["--anchor", "A", "--config", "nowhere.toml"], "nowhere.toml"),
        (["--anchor", "A", "--lag", "2"], "give both"),
        (["--anchor", "A", "--engine", "paper", "--smooth"], "--smooth works with the engine fleet only"),
    ],
)
def test_unusable_input_is_an_error_with_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert call(write_square(tmp_path), *arguments) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("lag", [[], ["--lag"]])
def test_smoothed_poses_have_a_report_and_a_column_that_says_which_are_smoothed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lag: list[str]
) -> None:
    folder, filtered, smoothed = write_square(tmp_path, 0.05), tmp_path / "filtered.csv", tmp_path / "smoothed.csv"
    options = ["--anchor", "A", "--engine", "fleet", "--start=10,0,1.5708"]
    assert call(folder, *options, "--out", filtered) == 0
    before = float(capsys.readouterr().out.split("RMSE ")[1].split()[0])
    assert call(folder, *options, "--smooth", *lag, "--out", smoothed) == 0
    said = capsys.readouterr().out
    after = float(said.split("RMSE ")[1].split()[0])
    assert after < (2.0 if lag else before)  # a single run with a lag need not be better than the filter
    assert [row["t_s"] for row in rows(smoothed)] == [row["t_s"] for row in rows(filtered)]
    assert list(rows(smoothed)[0]) == [*replay.COLUMNS, "source"]
    sources = [row.pop("source") for row in rows(smoothed)]
    assert f"smoothed: {sources.count('smoothed') / len(sources):.1%} of the poses" in said
    as_filtered = [source == "filtered" for source in sources]
    assert 0 < sum(as_filtered) < len(sources)
    for is_filtered, one, other in zip(as_filtered, rows(smoothed), rows(filtered), strict=True):
        assert not is_filtered or one == {**other, "source": "filtered"}


@pytest.mark.parametrize("lag", ["-1", "61", "nan", "soon"])
def test_an_invalid_lag_is_an_error(tmp_path: Path, lag: str) -> None:
    with pytest.raises(SystemExit, match="2"):
        call(write_square(tmp_path), "--smooth", f"--lag={lag}")


@pytest.mark.parametrize("start", ["1", "1,2,3,4", "a,b", "nan,0,0"])
def test_an_invalid_start_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str], start: str) -> None:
    with pytest.raises(SystemExit, match="2"):
        call(write_square(tmp_path), "--start", start)
    assert "X,Y,HEADING" in capsys.readouterr().err


def test_option_values_can_begin_with_a_minus(tmp_path: Path) -> None:
    out = tmp_path / "poses.csv"
    folder = str(write_square(tmp_path))
    options = [
        "--start",
        "-4.5,-2,-1.5",
        "--range-bias",
        "-1e-3",
        "--mount-angle",
        "-.1",
        "--out",
        str(out),
    ]
    assert main(["replay", folder, "--anchor", "A", "--engine", "paper", *options]) == 0
    assert float(rows(out)[0]["x"]) < -3.0


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "anchor", "start"),
    [("tiers_B", "L0", "1.3836,1.3673,-2.2287"), ("iasl_s1", "1", "4.4008,4.0954,1.5418")],
)
def test_real_recordings_run_to_the_end(tmp_path: Path, name: str, anchor: str, start: str) -> None:
    folder, out = recording_or_skip(name), tmp_path / "poses.csv"
    assert call(folder, "--anchor", anchor, "--engine", "paper", f"--start={start}", "--out", out) == 0
    assert len(rows(out)) > 500

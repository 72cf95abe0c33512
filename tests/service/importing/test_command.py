"""`dropanchor import` refuses what it cannot use with a sentence, and leaves nothing half-written."""

import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest

from dropanchor_service.cli import main
from dropanchor_tag_client.recording import read_recording
from service.importing import formats
from service.importing.command import Import
from support.commands import start_python
from support.patience import PATIENCE_S

TABLE = "t,anchor,range\n0.0,A,5.5\n0.1,A,5.25\n"


@pytest.mark.parametrize(
    ("content", "options", "sentence"),
    [
        ("a,b\n1,2\n", [], "no column is known as a time with a range, or with three axes of an IMU: uwb.csv has a, b"),
        ("", [], "uwb.csv is empty"),
        ("hello\nworld\n", [], "uwb.csv is no table: its lines have no columns"),
        (
            TABLE,
            ["--map", "t=t", "range=range:furlong"],
            "'furlong' is not a known unit: of a range, the known ones are m, cm,",
        ),
        (
            TABLE,
            ["--map", "t=t:g", "range=range"],
            "'g' is not a known unit: of a time, the known ones are s, ms, us, ns",
        ),
        (TABLE, ["--map", "t=t", "range=dist"], "--map range=dist: no source has such a column"),
        (TABLE, ["--map", "t=t", "range=range", "ax=acc"], "--map ax=acc: no source has such a column"),
        (TABLE, ["--map", "t=t", "rnge=range"], "'rnge' is not a field; did you mean range?"),
        (TABLE, ["--map", "t"], "'t' is not FIELD=COLUMN"),
        (TABLE, ["--map", "t=t", "range=range", "anchor=anchor:m"], "anchor has no unit"),
        (TABLE, ["--map-file", "missing.toml"], "missing.toml"),
        (TABLE, ["--anchor", "B=1,2,3"], "--anchor B: there are ranges only to A"),
        (TABLE, ["--forward", "x", "--up=-x"], "must be different axes"),
        (TABLE + "soon,A,5\n", ["--map", "t=anchor", "range=range"], "no row has a time in the column 'anchor'"),
        ('{"a": 1}\n', [], "no column is known"),
    ],
)
def test_what_cannot_be_used_is_a_sentence_and_writes_nothing(
    run: Import, content: str, options: list[str], sentence: str
) -> None:
    ended = run(run.file("uwb.csv", content), *options)
    assert ended.status == 2
    assert sentence in ended.error
    assert ended.error.startswith("dropanchor import: ")
    assert sorted(path.name for path in run.folder.iterdir()) == ["uwb.csv"]


def test_a_source_that_is_not_there_is_named(run: Import) -> None:
    assert "none.csv does not exist" in run(run.folder / "none.csv").error


@pytest.mark.parametrize("damage", ["cut", "overwritten"])
def test_a_damaged_zip_is_named(run: Import, damage: str) -> None:
    path = formats.zipped(run.folder / "phone.zip", {"uwb.csv": TABLE * 500})
    whole = path.read_bytes()
    path.write_bytes(whole[:200] if damage == "cut" else whole[:60] + b"\xff" * 40 + whole[100:])
    ended = run(path)
    assert ended.status == 2
    assert "phone.zip" in ended.error
    assert ("damaged zip archive" if damage == "cut" else "uwb.csv cannot be read") in ended.error


@pytest.mark.parametrize(
    ("toml", "sentence"),
    [
        ("[map", "is not TOML"),
        ("[map]\nt = 1\n", "t is not a text"),
        ("[other]\nt = 'a'\n", '[other] is not known; there are [map] and [source."NAME"]'),
        ("[map]\nrnge = 'range'\n", "'rnge' is not a field; did you mean range?"),
    ],
)
def test_a_file_of_a_mapping_that_is_wrong_is_named(run: Import, toml: str, sentence: str) -> None:
    ended = run(run.file("uwb.csv", TABLE), "--map-file", run.file("map.toml", toml))
    assert ended.status == 2
    assert sentence in ended.error


def test_a_folder_that_is_not_empty_is_refused_and_force_replaces_only_the_recording(run: Import) -> None:
    table = run.file("uwb.csv", TABLE)
    for name in ("notes.txt", "imu.csv", "truth.csv.gz"):
        run.file(f"out/{name}", "mine")
    refused = run(table)
    assert refused.status == 2
    assert "out is not empty: choose another folder, or replace the recording in it with --force" in refused.error
    assert run(table, "--force").status == 0
    assert sorted(path.name for path in refused.out.iterdir()) == ["anchors.csv", "notes.txt", "range.csv"]


def test_an_empty_folder_and_folders_above_that_are_missing_are_used(run: Import) -> None:
    table = run.file("uwb.csv", TABLE)
    (run.folder / "out").mkdir()
    assert run(table).status == 0
    assert run(table, out="a/b/c").status == 0
    assert read_recording(run.folder / "a/b/c").range_anchors == ("A", "A")


def test_a_second_gyroscope_is_refused(run: Import) -> None:
    imu = "t,ax,ay,az,gx,gy,gz\n0,0,0,9.8,0,0,0\n"
    ended = run(run.file("a.csv", imu), run.file("b.csv", imu))
    assert ended.status == 2
    assert "b.csv has a second accelerometer: import it alone, or leave it out with --map" in ended.error


def test_ctrl_c_leaves_nothing_half_written(tmp_path: Path) -> None:
    rows = (f"{i / 100},A,{i % 97 / 10}\n" for i in range(300_000))
    (tmp_path / "uwb.csv").write_text("t,anchor,range\n" + "".join(rows))
    command = (
        "-m",
        "dropanchor_service",
        "import",
        "--without-imu",
        str(tmp_path / "uwb.csv"),
        "--out",
        str(tmp_path / "out"),
    )
    process = start_python(*command)
    try:
        while not list(tmp_path.glob(".out.*.part/range.csv")):
            assert process.poll() is None, "it ended before it wrote"
            time.sleep(0.002)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=PATIENCE_S)
    finally:
        with suppress(ProcessLookupError):
            process.kill()
    assert (process.returncode, error) == (130, "stopped: nothing was written\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["uwb.csv"]


def test_the_help_teaches_with_examples(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["import", "--help"])
    printed = capsys.readouterr().out
    assert "dropanchor import drive.mcap --out recordings/drive" in printed
    assert "range, std               m cm mm km ft in" in printed

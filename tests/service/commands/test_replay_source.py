"""What is no recording is named, with the command that makes a recording of it; never a traceback."""

import shlex
import zipfile
from pathlib import Path

import pytest
from mcap.writer import Writer

from service.commands.replays import call, read_rows
from support.recordings import write_square


def foreign_mcap(path: Path) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        writer.finish()


def assert_leads_to_the_import(path: Path, looks_like: str) -> None:
    ended = call(path)
    assert ended.status == 2
    assert f"{path} is not a recording of this service, but looks like {looks_like}" in ended.error
    words = shlex.split(ended.error.split("Make a recording of it: ")[1])
    assert words[:3] == ["dropanchor", "import", str(path)]
    assert words[3] == "--out"


@pytest.mark.parametrize(
    ("name", "content", "looks_like"),
    [
        ("run_0.db3", b"SQLite format 3\0", "a ROS 2 bag"),
        ("run.bag", b"#ROSBAG V2.0\n", "a ROS 1 bag"),
        ("my log.csv", b"t,r\n0,1\n", "a single table with the columns t, r"),
        ("log.jsonl", b'{"t": 1}\n', "a single table"),
    ],
)
def test_a_file_of_another_kind_is_named(tmp_path: Path, name: str, content: bytes, looks_like: str) -> None:
    (tmp_path / name).write_bytes(content)
    assert_leads_to_the_import(tmp_path / name, looks_like)


def test_a_zip_archive_and_a_bag_are_named(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "export.zip", "w") as archive:
        archive.writestr("Accelerometer.csv", "")
    assert_leads_to_the_import(tmp_path / "export.zip", "a zip archive")
    (tmp_path / "bag").mkdir()
    foreign_mcap(tmp_path / "bag" / "bag_0.mcap")
    assert_leads_to_the_import(tmp_path / "bag" / "bag_0.mcap", "an MCAP file of another program")
    assert_leads_to_the_import(tmp_path / "bag", "a ROS bag")


@pytest.mark.parametrize(
    ("names", "looks_like"),
    [
        (["Accelerometer.csv", "Gyroscope.csv"], "an export of phyphox"),
        (["Accelerometer.csv", "Gyroscope.csv", "Metadata.csv"], "an export of Sensor Logger"),
        (["sensors.csv"], "a folder of other tables (sensors.csv)"),
    ],
)
def test_a_folder_of_another_kind_is_named(tmp_path: Path, names: list[str], looks_like: str) -> None:
    for name in names:
        (tmp_path / name).write_text("a,b\n")
    assert_leads_to_the_import(tmp_path, looks_like)


def test_a_folder_of_recordings_lists_them(tmp_path: Path) -> None:
    (tmp_path / "yard").mkdir()
    write_square(tmp_path / "yard")
    assert "its folders are: yard. Give one of them" in call(tmp_path).error


@pytest.mark.parametrize(("content", "message"), [(b"", "is empty"), (b"\x01\x02\x00", "is not a recording: a")])
def test_junk_is_an_error(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "thing").write_bytes(content)
    assert message in call(tmp_path / "thing").error
    assert "does not exist" in call(tmp_path / "nothing").error


@pytest.mark.parametrize("table", ["anchors", "range", "heading", "truth"])
@pytest.mark.parametrize("content", [b"", b"\n\n", b"\0" * 50, b"\xff\xfe\x00", b"t_s\n1\n", b'"a\n', b"[]\n", b"PAR1"])
@pytest.mark.parametrize("ending", [".csv", ".csv.gz", ".jsonl", ".parquet"])
def test_a_table_of_junk_never_gives_a_traceback(tmp_path: Path, table: str, content: bytes, ending: str) -> None:
    write_square(tmp_path)
    (tmp_path / f"{table}.csv").unlink()
    (tmp_path / f"{table}{ending}").write_bytes(content)
    ended = call(tmp_path, "--anchor=A")
    assert (ended.status, ended.error.count("\n")) in [(2, 1), (0, 0)]  # 0: JSON lines without a line


@pytest.mark.parametrize("rows", [0, 1, 2])
@pytest.mark.parametrize("table", ["range", "heading", "truth"])
def test_tables_of_few_rows_are_used_or_named(tmp_path: Path, table: str, rows: int) -> None:
    lines = (write_square(tmp_path) / f"{table}.csv").read_text().splitlines()
    (tmp_path / f"{table}.csv").write_text("\n".join(lines[: rows + 1]) + "\n")
    ended = call(tmp_path, "--anchor=A", "--start=10,0,1.57", "--out", tmp_path / "poses.csv")
    assert ended.status == (2 if table == "range" and rows == 0 else 0)
    if ended.status == 0:
        assert len(read_rows(tmp_path / "poses.csv")) == (rows if table == "range" else 600)


@pytest.mark.parametrize("value", ["nan", "inf", "1e300", "-1e18"])
@pytest.mark.parametrize(("table", "column"), [("range", 2), ("heading", 1), ("truth", 1)])
def test_a_column_of_impossible_numbers_is_used_or_named(tmp_path: Path, table: str, column: int, value: str) -> None:
    header, *rows = [line.split(",") for line in (write_square(tmp_path) / f"{table}.csv").read_text().splitlines()]
    changed = [[*row[:column], value, *row[column + 1 :]] for row in rows]
    (tmp_path / f"{table}.csv").write_text("\n".join(map(",".join, [header, *changed])) + "\n")
    ended = call(tmp_path, "--anchor=A")
    assert ended.status == (2 if table == "range" else 0)
    assert "Traceback" not in ended.error

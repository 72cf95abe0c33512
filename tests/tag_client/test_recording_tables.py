"""Recordings are read from CSV, JSON lines and Parquet, and what is wrong with a table is named."""

import gzip
import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dropanchor_tag_client.recording import RecordingError, read_recording

ANCHORS = "id,x,y,z\n7,0,0,0\n"
RANGES = [{"t_s": i / 10, "anchor_id": 7, "range_m": 5.0 + i, "std_m": None if i else 0.1} for i in range(4)]
CSV = "t_s,anchor_id,range_m,std_m\n0.0,7,5,0.1\n0.1,7,6,\n0.2,7,7,\n0.3,7,8,\n"


def folder_with(folder: Path, name: str, content: bytes | str) -> Path:
    (folder / "anchors.csv").write_text(ANCHORS)
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


def assert_is_read(folder: Path) -> None:
    read = read_recording(folder)
    assert list(read.ranges["t_s"]) == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert list(read.ranges["range_m"]) == [5.0, 6.0, 7.0, 8.0]
    assert read.ranges["std_m"][0] == 0.1
    assert read.range_anchors == ("7",) * 4


def test_tables_may_be_json_lines(tmp_path: Path) -> None:
    text = "\n".join(map(json.dumps, RANGES))
    assert_is_read(folder_with(tmp_path, "range.jsonl", text))
    (tmp_path / "range.jsonl").unlink()
    assert_is_read(folder_with(tmp_path, "range.jsonl.gz", gzip.compress(text.encode())))


def test_tables_may_be_parquet_also_with_timestamps(tmp_path: Path) -> None:
    folder_with(tmp_path, "range.parquet", b"")
    pq.write_table(pa.Table.from_pylist(RANGES), tmp_path / "range.parquet")
    assert_is_read(tmp_path)
    table = pa.Table.from_pylist(RANGES)
    stamps = pa.array([1_700_000_000_000_000 + 100_000 * i for i in range(4)], pa.timestamp("us", tz="UTC"))
    pq.write_table(table.set_column(0, "t_s", stamps), tmp_path / "range.parquet")
    read = read_recording(tmp_path)
    assert read.ranges["t_s"][3] == pytest.approx(1_700_000_000.3)
    assert read.notes == ()


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbf" + CSV.encode(),
        CSV.encode("utf-16"),
        b"# recorded by a logger\n\n" + CSV.replace("\n", "\n\n").encode() + b"# end\n,,,\n",
        CSV.replace("\n", "\r\n").encode(),
        CSV.replace(",", ", ").encode(),
    ],
)
def test_byte_order_marks_comments_and_empty_lines_do_no_harm(tmp_path: Path, content: bytes) -> None:
    assert_is_read(folder_with(tmp_path, "range.csv", content))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("range.csv", CSV.replace(",", ";"), r"range.csv line 1: the columns are separated by semicolons"),
        ("range.csv", CSV.replace(",", "\t"), r"range.csv line 1: the columns are separated by tabs"),
        ("range.csv", CSV.replace("7,6,", '7,"6,5",'), r"line 3: range_m is '6,5', .*: it has a decimal comma"),
        ("range.csv", "", "range.csv is empty"),
        ("range.csv", b"t_s,anchor_id,range_m\n\0\0\1", "line 2 cannot be read: this is not text"),
        ("range.csv", CSV.replace("t_s", "time"), r"the columns t_s \(or t_ms, t_us, t_ns\) are missing; there are:"),
        ("range.jsonl", "{}", "range.jsonl line 1: the columns anchor_id, range_m, t_s .* are missing"),
        ("range.jsonl", "[1]", "range.jsonl line 1: a JSON object was expected"),
        ("range.jsonl", json.dumps(RANGES[0]) + "\n{", "range.jsonl line 2 is not JSON"),
        ("range.jsonl", json.dumps(RANGES[0] | {"range_m": True}), "line 1: range_m is True, a number was expected"),
        ("range.parquet", b"PAR1 and then nothing", "range.parquet cannot be read"),
    ],
)
def test_a_bad_table_is_an_error_that_names_the_cause(
    tmp_path: Path, name: str, content: bytes | str, message: str
) -> None:
    with pytest.raises(RecordingError, match=message):
        read_recording(folder_with(tmp_path, name, content))


@pytest.mark.parametrize("separator", [";", "\t"])
def test_other_separators_lead_to_the_import(tmp_path: Path, separator: str) -> None:
    folder = tmp_path / "my yard"
    folder.mkdir()
    with pytest.raises(RecordingError, match=f"dropanchor import '{folder}' --out 'my yard-imported'"):
        read_recording(folder_with(folder, "range.csv", CSV.replace(",", separator)))


@pytest.mark.parametrize("position", ["nan,0,0", "0,inf,0", "0,0,1e300"])
def test_an_anchor_must_be_somewhere(tmp_path: Path, position: str) -> None:
    folder_with(tmp_path, "range.csv", CSV)
    (tmp_path / "anchors.csv").write_text(f"id,x,y,z\n7,{position}\n")
    with pytest.raises(RecordingError, match=r"anchors.csv line 2: a position in m was expected"):
        read_recording(tmp_path)

"""Recordings are read from folders of CSV files."""

import gzip
import math
from pathlib import Path

import pytest

from dropanchor_tag_client.recording import RecordingError, read_recording

ANCHORS = "id,x,y,z\nL0,1.0,2.0,0.5\n7,0,0,0\n"
RANGES = "t_s,anchor_id,range_m\n0.0,L0,1.5\n0.2,7,2.5\n0.1,L0,1.75\n"


def write(folder: Path, **files: str) -> Path:
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    return folder


def test_ranges_come_in_order_of_time_with_their_anchors(tmp_path: Path) -> None:
    recording = read_recording(write(tmp_path, anchors=ANCHORS, range=RANGES))
    assert list(recording.ranges["t_s"]) == [0.0, 0.1, 0.2]
    assert list(recording.ranges["range_m"]) == [1.5, 1.75, 2.5]
    assert recording.range_anchors == ("L0", "L0", "7")
    assert all(math.isnan(std) for std in recording.ranges["std_m"])
    assert len(recording.imu["t_s"]) == 0
    assert recording.anchor("L0").z == 0.5


def test_gzipped_files_and_optional_columns_are_read(tmp_path: Path) -> None:
    write(tmp_path, anchors=ANCHORS)
    text = "t_s,anchor_id,range_m,std_m\n0.0,L0,1.5,0.2\n0.1,L0,1.5,\n"
    (tmp_path / "range.csv.gz").write_bytes(gzip.compress(text.encode()))
    write(tmp_path, imu="t_s,ax,ay,az,gx,gy,gz\n0,0,0,9.8,0,0,0.1\n", heading="t_s,yaw_rad,std_rad\n0,1,0.1\n")
    recording = read_recording(tmp_path)
    assert recording.ranges["std_m"][0] == 0.2
    assert math.isnan(recording.ranges["std_m"][1])
    assert recording.imu["az"][0] == 9.8
    assert math.isnan(recording.imu["mx"][0])
    assert recording.headings["std_rad"][0] == 0.1


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({}, "neither anchors.csv nor anchors.csv.gz"),
        ({"anchors": ANCHORS}, "neither range.csv nor range.csv.gz"),
        ({"anchors": "id,x,y,z\n", "range": RANGES}, "holds no anchor"),
        ({"anchors": ANCHORS + "7,1,1,1\n", "range": RANGES}, "names an anchor twice"),
        ({"anchors": ANCHORS, "range": RANGES + "0.3,9,1.0\n"}, "ranges to 9, which anchors.csv does not have"),
        ({"anchors": ANCHORS, "range": RANGES + "0.3,7,abc\n"}, "line 5: range_m is 'abc', a number was expected"),
        ({"anchors": ANCHORS, "range": RANGES + "0.3,7,\n"}, "line 5: range_m is empty"),
        ({"anchors": ANCHORS, "range": RANGES + "nan,7,1\n"}, "line 5: t_s is 'nan', a finite number"),
        ({"anchors": ANCHORS, "range": RANGES + "0.3,7\n"}, "line 5: 3 values were expected"),
        ({"anchors": ANCHORS, "range": RANGES + "0.3,7,1,1\n"}, "line 5: 3 values were expected"),
        ({"anchors": ANCHORS, "range": "t_s,range_m\n0,1\n"}, "line 1: the columns anchor_id are missing"),
        ({"anchors": ANCHORS, "range": RANGES, "imu": "t_s,ax\n0,1\n"}, "line 1: the columns ay, az, gx, gy, gz are"),
    ],
)
def test_a_bad_folder_is_an_error_that_names_the_location(tmp_path: Path, files: dict[str, str], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        read_recording(write(tmp_path, **files))


def test_a_truncated_gzip_file_and_invalid_utf_8_are_errors(tmp_path: Path) -> None:
    write(tmp_path, anchors=ANCHORS)
    (tmp_path / "range.csv.gz").write_bytes(gzip.compress(RANGES.encode())[:-9])
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording(tmp_path)
    (tmp_path / "range.csv").write_bytes(b"t_s,anchor_id,range_m\n0.0,\xff,1\n")
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording(tmp_path)


def test_a_missing_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="is not a folder"):
        read_recording(tmp_path / "nothing")


def test_a_missing_anchor_is_an_error_that_lists_the_anchors(tmp_path: Path) -> None:
    recording = read_recording(write(tmp_path, anchors=ANCHORS, range=RANGES))
    with pytest.raises(RecordingError, match="no anchor 'X'; it has: L0, 7"):
        recording.anchor("X")


def test_pressures_are_read_with_the_temperature_of_the_air_where_it_is_known(tmp_path: Path) -> None:
    text = "t_s,pressure_pa,temperature_c\n0.0,101325,21.5\n0.1,101300,\n"
    recording = read_recording(write(tmp_path, anchors=ANCHORS, range=RANGES, pressure=text))
    assert list(recording.pressures["pressure_pa"]) == [101_325.0, 101_300.0]
    assert recording.pressures["temperature_c"][0] == 21.5
    assert math.isnan(recording.pressures["temperature_c"][1])

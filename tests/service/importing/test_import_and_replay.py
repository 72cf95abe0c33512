"""A drive in each format is imported, and its replay gives the poses of the original recording."""

import csv
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores

from dropanchor_service.cli import main
from dropanchor_tag_client.recording import Recording
from service.importing import formats

CLOSE_M = 0.005

Sources = list[str]


def poses(folder: Path, out: Path, anchor: str) -> dict[str, tuple[float, float]]:
    assert main(["replay", str(folder), "--anchor", anchor, "--out", str(out)]) == 0
    with out.open(newline="") as file:
        return {row["t_s"]: (float(row["x"] or "nan"), float(row["y"] or "nan")) for row in csv.DictReader(file)}


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, dict[str, tuple[float, float]]]:
    folder = tmp_path_factory.mktemp("drive")
    recording = formats.drive(folder / "original")
    return recording, poses(folder / "original", folder / "poses.csv", recording.anchors[0].id)


def semicolons(folder: Path, drive: Recording) -> Sources:
    """Times in ms, accelerations in g, turn rates in deg/s, ranges in cm; the field stays in µT."""
    times, imu = formats.imu_of(drive)
    rows = [
        (f"{t_ns / 1e6:.3f}", *(v / formats.G_MPS2 for v in row[:3]), *map(math.degrees, row[3:6]), *row[6:])
        for t_ns, row in zip(times, imu.tolist(), strict=True)
    ]
    header = ("Time [ms]", *(f"acc_{a} [g]" for a in "xyz"), *(f"gyro_{a} [deg/s]" for a in "xyz"), "mx", "my", "mz")
    (folder / "imu.csv").write_text(formats.text(header, rows, ";", comma=True))
    ranges = [(f"{t_ns / 1e6:.3f}", anchor, r * 100) for t_ns, anchor, r in formats.ranges_of(drive)]
    header = ("Time [ms]", "Anchor", "Distance [cm]")
    (folder / "uwb.csv").write_text(formats.text(header, ranges, ";", comma=True))
    return [str(folder / "imu.csv"), str(folder / "uwb.csv")]


def phyphox(folder: Path, drive: Recording) -> Sources:
    export = formats.phyphox(folder / "export", drive, ";", comma=True)
    return [str(export), str(formats.write_range_csv(folder / "uwb.csv", drive))]


def android(folder: Path, drive: Recording) -> Sources:
    export = formats.sensor_logger(folder / "phone.zip", drive)
    return [str(export), str(formats.write_range_csv(folder / "uwb.csv", drive))]


def iphone(folder: Path, drive: Recording) -> Sources:
    export = formats.sensor_logger(folder / "phone.zip", drive, ios=True, platform="ios")
    return [str(export), str(formats.write_range_csv(folder / "uwb.csv", drive))]


def ros1(folder: Path, drive: Recording) -> Sources:
    ros = formats.Messages(Stores.ROS1_NOETIC)
    return [str(formats.ros1_bag(folder / "drive.bag", formats.messages_of(drive, ros), ros))]


def ros2(folder: Path, drive: Recording) -> Sources:
    ros = formats.Messages(Stores.ROS2_JAZZY)
    return [str(formats.ros2_bag(folder / "drive", formats.messages_of(drive, ros), ros, StoragePlugin.MCAP))]


@pytest.mark.parametrize("make", [semicolons, phyphox, android, iphone, ros1, ros2])
def test_a_converted_drive_gives_the_poses_of_the_original(
    tmp_path: Path,
    original: tuple[Recording, dict[str, tuple[float, float]]],
    make: Callable[[Path, Recording], Sources],
) -> None:
    drive, expected = original
    anchor = drive.anchors[0]
    place = f"{anchor.id}={anchor.x},{anchor.y},{anchor.z}"
    sources = make(tmp_path, drive)
    if make in (ros1, ros2):
        sources += ["--range", f"/uwb={anchor.id}"]
    assert main(["import", *sources, "--anchor", place, "--out", str(tmp_path / "out")]) == 0
    found = poses(tmp_path / "out", tmp_path / "poses.csv", anchor.id)
    assert list(found) == list(expected)
    known = [t for t, place_ in expected.items() if math.isfinite(place_[0])]
    assert len(known) > 100
    assert max(math.dist(found[t], expected[t]) for t in known) < CLOSE_M

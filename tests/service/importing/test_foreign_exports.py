"""Exports that are only known by the words and units of their columns, and by their values, are read or named."""

import json
import math
import shlex
import zipfile
from collections.abc import Callable
from typing import Any

import pandas
import pytest

from dropanchor_service.importing.readings import ImportingError
from dropanchor_service.importing.tables.units import SI, conversion
from dropanchor_tag_client.recording import read_recording
from service.importing.command import Ended, Import

G, DEGREES = 9.80665, math.degrees(0.5)
UWB = "time_s,anchor,distance_m\n0.0,1,5.5\n0.1,1,5.25\n"


def table(header: str, row: Callable[[int], tuple[Any, ...]], separator: str = ",", count: int = 60) -> str:
    rows = (separator.join(map(str, row(i))) for i in range(count))
    return "\n".join([header, *rows]) + "\n"


def advice(ended: Ended, after: str) -> list[str]:
    """Return the words of `--map` that stand behind this text."""
    line = next(line for line in ended.printed.splitlines() if after in line)
    words = shlex.split(line.split(after)[1].partition("--map ")[2])
    return ["--map", *(word.rstrip(",") for word in words if "=" in word)]


ANDROSENSOR = (
    "ACCELEROMETER X (m/s²);ACCELEROMETER Y (m/s²);ACCELEROMETER Z (m/s²);GRAVITY X (m/s²);GRAVITY Y (m/s²);"
    "GRAVITY Z (m/s²);LINEAR ACCELERATION X (m/s²);LINEAR ACCELERATION Y (m/s²);LINEAR ACCELERATION Z (m/s²);"
    "GYROSCOPE X (rad/s);GYROSCOPE Y (rad/s);GYROSCOPE Z (rad/s);MAGNETIC FIELD X (μT);MAGNETIC FIELD Y (μT);"
    "MAGNETIC FIELD Z (μT);Time since start in ms ;YYYY-MO-DD HH-MI-SS_SSS"
)
EXPORTS = {
    "Physics Toolbox": table(
        "time,gFx,gFy,gFz,wx,wy,wz,Bx,By,Bz,", lambda i: (i / 100, 0, 0, 1, 0, 0, 0.5, 20, 0, -40, "")
    ),
    "Physics Toolbox with linear": table(
        "time,ax,ay,az,gFx,gFy,gFz,wx,wy,wz", lambda i: (i / 100, 0, 0, 0, 0, 0, 1, 0, 0, 0.5)
    ),
    "WitMotion": table(
        "time,DeviceName,AccX(g),AccY(g),AccZ(g),AsX(°/s),AsY(°/s),AsZ(°/s),AngleX(°),AngleY(°),AngleZ(°),HX(uT),HY(uT),"
        "HZ(uT),Temperature(°C)",
        lambda i: (f"2026-11-26 08:00:00.{10 * i:03}", "WT", 0, 0, 1, 0, 0, DEGREES, 1, 2, 3, 20, 0, -40, 25),
    ),
    "WitMotion, old": table(
        "Time(s)\tax(g)\tay(g)\taz(g)\twx(deg/s)\twy(deg/s)\twz(deg/s)\tAngleX(deg)\tT(°)\thx\thy\thz",
        lambda i: (i / 100, 0, 0, 1, 0, 0, DEGREES, 5, 25, 1, 2, 3),
        "\t",
    ),
    "AndroSensor": table(
        ANDROSENSOR,
        lambda i: (0, 0, G, 0, 0, G, 0, 0, 0, 0, 0, 0.5, 20, 0, -40, 10 * i, f"2026-11-26 08-00-00_{10 * i:03}"),
        ";",
    ),
    "Xsens": table(
        "// Device: 1\nPacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z",
        lambda i: (51400 + i, 777_000 + 100 * i, 0, 0, G, 0, 0, 0.5),
        "\t",
    ),
    "SensorLog of an iPhone": table(
        "loggingTime(txt),accelerometerAccelerationX(G),accelerometerAccelerationY(G),accelerometerAccelerationZ(G),"
        "gyroRotationX(rad/s),gyroRotationY(rad/s),gyroRotationZ(rad/s),motionUserAccelerationX(G)",
        lambda i: (f"2026-11-26T08:00:00.{10 * i:03}+01:00", 0, 0, -1, 0, 0, 0.5, 0),
    ),
    "rostopic echo -p": table(
        "%time,field.header.seq,"
        + ",".join(f"field.{name}.{axis}" for name in ("angular_velocity", "linear_acceleration") for axis in "xyz"),
        lambda i: (1_795_680_000_000_000_000 + 10_000_000 * i, i, 0, 0, 0.5, 0, 0, G),
    ),
    "a temperature called T": table(
        "T,time,ax,ay,az,gx,gy,gz", lambda i: (24 + i % 3 / 10, i / 100, 0, 0, G, 0, 0, 0.5)
    ),
    "a temperature called T with its unit": table(
        "T(°C),ms,time,ax,ay,az,gx,gy,gz", lambda i: (24, 0, i / 100, 0, 0, G, 0, 0, 0.5)
    ),
}


@pytest.mark.parametrize("content", EXPORTS.values(), ids=EXPORTS)
def test_an_imu_is_read_whatever_its_columns_are_called(run: Import, content: str) -> None:
    ended = run(run.file("imu.csv", content), imu=True)
    assert ended.status == 0, ended.error
    assert ended.column("imu", "az") == pytest.approx([G] * 60)
    assert ended.column("imu", "gz") == pytest.approx([0.5] * 60)
    assert ended.column("imu", "t_s")[-1] - ended.column("imu", "t_s")[0] == pytest.approx(0.59)
    if "B" in content or "(uT)" in content or "(μT)" in content:
        assert ended.column("imu", "mz") == pytest.approx([-40] * 60)


def test_sensor_logger_in_one_file_of_json_is_read_like_its_folder(
    run: Import, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows: list[dict[str, str]] = [{"sensor": "Metadata", "platform": "android", "device name": "Phone"}]
    for i in range(50):
        time = {"time": str(1_795_680_000_000_000_000 + 10_000_000 * i), "seconds_elapsed": str(i / 100)}
        rows += [{"sensor": "TotalAcceleration", **time, "x": "0", "y": "0", "z": str(G)}]
        rows += [{"sensor": "Gyroscope", **time, "x": "0", "y": "0", "z": "0.5"}]
        rows += [{"sensor": "Barometer", **time, "relativeAltitude": "0", "pressure": "987.25"}]
        rows += [{"sensor": "Location", **time, "latitude": "52.5"}]
    ended = run(run.file("walk.json", json.dumps(rows)), imu=True)
    assert ended.status == 0, ended.error
    assert ended.column("imu", "az") == pytest.approx([G] * 50)
    assert ended.column("pressure", "pressure_pa") == pytest.approx([98_725] * 50)
    assert "walk.json: an export of Sensor Logger (Phone, android)" in ended.printed
    assert "not used: walk.json: Location" in ended.printed
    run.file("trip/walk.json", json.dumps(rows))
    monkeypatch.chdir(run.folder / "trip")
    assert "trip: an export of Sensor Logger (Phone, android)" in run(".", out="other", imu=True).printed


@pytest.mark.parametrize(
    ("name", "content", "truth"),
    [
        ("truth.csv", "t_s,x,y,z,yaw_rad\n0,1,2,0.5,3.1\n1,2,2,0.5,3\n", {"x": 1, "y": 2, "z": 0.5, "yaw_rad": 3.1}),
        ("groundtruth.txt", "#t tx ty tz qx qy qz qw\n0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n", {"x": 1, "y": 2, "z": 3}),
        ("log.csv", "time_s,gt_x [cm],gt_y [cm]\n0,100,200\n1,100,\n2,1,1\n", {"x": 1, "y": 2}),
    ],
)
def test_a_truth_goes_into_the_recording_on_its_clock(
    run: Import, name: str, content: str, truth: dict[str, float]
) -> None:
    uwb = run.file("uwb.csv", UWB)
    ended = run(uwb, run.file(name, content))
    assert ended.status == 0, ended.error
    first = {column: float(value) for column, value in ended.rows("truth")[0].items()}
    assert first == {"t_s": 0.0} | truth
    assert len(ended.rows("truth")) == 2
    assert "truth       2" in ended.printed
    assert len(read_recording(ended.out).truth["t_s"]) == 2


def test_parquet_is_a_table(run: Import) -> None:
    times = pandas.to_datetime([f"2026-11-26T08:00:00.{100 * i:03}Z" for i in range(5)])
    frame = pandas.DataFrame({"time": times, "anchor": "A", "distance_cm": [500.0 + i for i in range(5)]})
    frame.to_parquet(run.folder / "uwb.parquet")
    ended = run(run.folder / "uwb.parquet")
    assert ended.status == 0, ended.error
    assert ended.column("range", "range_m") == pytest.approx([5 + i / 100 for i in range(5)])
    assert ended.column("range", "t_s") == pytest.approx([i / 10 for i in range(5)])
    assert {row["anchor_id"] for row in ended.rows("range")} == {"A"}
    broken = run(run.file("broken.parquet", "PAR1 no"), out="other")
    assert (broken.status, "broken.parquet cannot be read" in broken.error) == (2, True)


@pytest.mark.parametrize(
    ("header", "ids", "anchors"),
    [
        ("from_id,to_id", lambda i: (10, 1 + i % 2), {"1", "2"}),
        ("to_id,from_id", lambda i: (10, 1 + i % 2), {"1", "2"}),
        ("mac,mac_dest", lambda i: ("AA:01", f"BB:0{i % 2}"), {"BB:00", "BB:01"}),
        ("from_id,to_id", lambda _: (10, 1), {"1"}),
        ("src,dst", lambda _: ("7", "8"), {"8"}),
        ("id,seq", lambda i: ("A", i), {"A"}),
        ("id,from", lambda i: (i, "A"), {"1"}),
        ("node_id,mac", lambda i: (i % 2, f"M{i % 2}"), {"0", "1"}),
    ],
)
def test_of_two_ids_that_one_is_the_anchor_that_changes(
    run: Import, header: str, ids: Callable[[int], tuple[Any, ...]], anchors: set[str]
) -> None:
    places = [word for name in anchors for word in ("--anchor", f"{name}=0,0,0")]
    content = table(f"time_s,range_m,{header}", lambda i: (i / 10, 5 + i % 2, *ids(i)))
    ended = run(run.file("uwb.csv", content), *places)
    assert ended.status == 0, ended.error
    assert {row["anchor_id"] for row in ended.rows("range")} == anchors
    assert "divide" not in ended.printed


@pytest.mark.parametrize(
    ("header", "ids", "sentence"),
    [
        ("tag_id,anchor", lambda i: (i % 2, "A"), "uwb.csv has ranges of 2 tags (tag_id: 0, 1): a recording is of one"),
        ("from_id,to_id", lambda i: (i % 2, i // 2 % 3), "from_id and to_id take several values each"),
    ],
)
def test_ranges_of_several_tags_are_not_merged(
    run: Import, header: str, ids: Callable[[int], tuple[Any, ...]], sentence: str
) -> None:
    ended = run(run.file("uwb.csv", table(f"time_s,range_m,{header}", lambda i: (i / 10, 5, *ids(i)))))
    assert ended.status == 2
    assert sentence in ended.error


LOG = table(
    "millis;accX;accY;accZ;gyrX;gyrY;gyrZ;A1;A2",
    lambda i: (5231 + 10 * i, 0, 0, 1, 0, 0, 50 if i % 2 else -50, 18.25 + i // 10, -1 if i < 30 else 7.5),
    ";",
    400,
)


def test_each_advice_works_as_it_is_printed_and_changes_nothing_else(run: Import) -> None:
    source = run.file("log.txt", LOG)
    first = run(source, imu=True)
    words: list[str] = []
    for after in ("are they deg/s? Here:", "`acc_unit` to g. Here:", "are A1, A2 ranges?"):
        words += advice(first, after)
    places = ["--anchor", "A1=0,0,0", "--anchor", "A2=3,0,0"]
    ended = run(source, *words, *places, "--force", imu=True)
    assert ended.status == 0, ended.error
    assert ended.column("imu", "az") == pytest.approx([G] * 400)
    assert ended.column("imu", "gz")[1] == pytest.approx(math.radians(50))
    assert {row["anchor_id"] for row in ended.rows("range")} == {"A1", "A2"}
    assert min(ended.column("range", "range_m")) > 0
    assert "log.txt: 30 left out: the range is below zero" in ended.printed
    assert "Here:" not in ended.printed


@pytest.mark.parametrize("quantity", SI)
def test_an_unknown_unit_of_any_quantity_is_named_with_those_that_are_known(quantity: str) -> None:
    with pytest.raises(ImportingError, match=f"'furlongs' is not a known unit: of an? .*{SI[quantity]}"):
        conversion("furlongs", quantity)


def test_counts_of_a_sensor_are_named_with_their_usual_scale(run: Import) -> None:
    source = run.file(
        "mpu.csv", table("ms,AcX,AcY,AcZ,Tmp,GyX,GyY,GyZ", lambda i: (10 * i, 0, 0, 16384, 24, 0, 0, 655))
    )
    first = run(source, "--map", "t=ms:ms", imu=True)
    ended = run(source, "--map", "t=ms:ms", *advice(first, "±250 deg/s:"), "--force", imu=True)
    assert ended.column("imu", "az") == pytest.approx([G] * 60)
    assert ended.column("imu", "gz") == pytest.approx([math.radians(5)] * 60)
    assert "look like counts" not in ended.printed


def test_columns_called_like_anchors_may_be_the_only_ranges(run: Import) -> None:
    source = run.file("wide.csv", table("time_s,UWB_1,UWB_2", lambda i: (i / 10, 3.1, 4.2)))
    refused = run(source)
    assert "are UWB_1, UWB_2 ranges? --map range.UWB_1=UWB_1:m range.UWB_2=UWB_2:m says so" in refused.error


def test_a_field_without_a_column_is_left_out(run: Import) -> None:
    imu = table("t,ax,ay,az,gx,gy,gz", lambda i: (i / 100, 0, 0, G, 0, 0, 0.5))
    both = table("t,ax,ay,az,gx,gy,gz,range", lambda i: (i / 100, 0, 0, G, 0, 0, 0.5, 5 + i))
    a, b = run.file("a.csv", imu), run.file("b.csv", both)
    ended = run(a, b, "--map", "b.csv/ax=", "b.csv/gx=", imu=True)
    assert ended.status == 0, ended.error
    assert len(ended.rows("range")) == 60


def test_columns_without_a_time_are_named_and_the_advice_gives_them_one(run: Import) -> None:
    header = "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z"
    run.file("s/mt.txt", table(header, lambda i: (51400 + i, "NaN", 0, 0, G, 0, 0, 0.5), "\t"))
    run.file("s/uwb.csv", UWB)
    refused = run(run.folder / "s", imu=True)
    assert refused.status == 2
    assert "mt.txt: not used: no column tells the time of Acc_X, Acc_Y, Acc_Z, Gyr_X, Gyr_Y, Gyr_Z" in refused.printed
    ended = run(run.folder / "s", *advice(refused, "no column tells the time"), imu=True)
    assert ended.status in (0, 2), ended.error
    assert "gyro" in ended.printed or "not of one clock" in ended.error


def test_a_recording_without_imu_is_written_only_when_asked(run: Import) -> None:
    source = run.file("uwb.csv", UWB)
    refused = run(source, imu=True)
    assert refused.status == 2
    assert "there are no IMU samples" in refused.error
    assert "--without-imu" in refused.error
    assert not refused.out.exists()
    assert run(source).status == 0


def test_a_file_that_is_not_read_is_named(run: Import) -> None:
    run.file("s/uwb.csv", UWB)
    run.file("s/a.gcsv", "GYROFLOW IMU LOG\nt,gx,gy,gz,ax,ay,az\n0,1,2,3,4,5,6\n")
    run.file("s/log.ulg", b"ULog\x01\x12\x35\x01" + bytes(40))
    printed = run(run.folder / "s").printed
    assert "a.gcsv is not read" in printed
    assert "log.ulg is not read: it is a ULog of PX4. Make a table of it first: ulog2csv FILE" in printed


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        (
            "00000012.bin",
            b"\xa3\x95\x80\x80" + bytes(60),
            "a DataFlash log of ArduPilot. Make a table of it first: mavlogdump",
        ),
        ("09.ulg", b"ULog\x01\x12\x35\x01" + bytes(60), "a ULog of PX4"),
        ("data.h5", b"\x89HDF\r\n\x1a\n" + bytes(60), "HDF5"),
        ("data.mat", b"MATLAB 5.0 MAT-file" + bytes(60), "a MAT file of MATLAB"),
        ("phyphox.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(60), "an old Excel workbook"),
        ("walk.pcap", b"\xd4\xc3\xb2\xa1" + bytes(60), "a capture of network packets"),
        ("x.npy", b"\x93NUMPY\x01\x00" + bytes(60), "an array of NumPy"),
    ],
)
def test_a_known_binary_is_called_by_its_name_with_what_makes_a_table_of_it(
    run: Import, name: str, content: bytes, sentence: str
) -> None:
    ended = run(run.file(name, content))
    assert ended.status == 2
    assert f"{name} is not read: it is {sentence}" in ended.error


def test_a_workbook_is_no_archive_of_tables(run: Import) -> None:
    with zipfile.ZipFile(run.folder / "phyphox.xlsx", "w") as archive:
        archive.writestr("[Content_Types].xml", "<x/>")
        archive.writestr("xl/worksheets/sheet1.xml", "<x/>")
    ended = run(run.folder / "phyphox.xlsx")
    assert ended.status == 2
    assert "it is an Excel workbook. Make a table of it first: save the sheet as CSV" in ended.error

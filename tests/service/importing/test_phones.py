"""Exports of Sensor Logger and phyphox become the IMU of a tag, with the rules of phones that send live."""

import math
from itertools import pairwise
from pathlib import Path

import pytest

from dropanchor_tag_client.recording import Recording
from service.importing import formats
from service.importing.command import Ended, Import

IMU = ("ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz")


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Return the first two seconds of a drive."""
    whole = formats.drive(tmp_path_factory.mktemp("drive"))
    imu = {name: column[:200] for name, column in whole.imu.items()}
    return Recording(whole.name, whole.anchors, whole.range_anchors, whole.ranges, imu)


def worst(ended: Ended, drive: Recording) -> float:
    """Return the largest difference of any component of the IMU."""
    assert ended.status == 0, ended.error
    pairs = [zip(ended.column("imu", name), drive.imu[name], strict=True) for name in IMU]
    return max(abs(found - true) for pair in pairs for found, true in pair)


@pytest.mark.parametrize(("separator", "comma"), [(",", False), ("\t", False), (";", False), ("\t", True), (";", True)])
def test_every_variant_of_the_export_of_phyphox_gives_the_axes_of_the_tag(
    run: Import, drive: Recording, separator: str, comma: bool
) -> None:
    ended = run(formats.phyphox(run.folder / "export", drive, separator, comma))
    assert worst(ended, drive) < 1e-8
    assert ended.column("imu", "t_s") == pytest.approx(list(drive.imu["t_s"]), abs=1e-9)
    assert "an export of phyphox" in ended.printed
    assert "there are no ranges" in ended.printed


def test_a_pause_of_phyphox_is_a_gap_in_utc(run: Import, drive: Recording) -> None:
    export = formats.phyphox(run.folder / "export", drive)
    times = export / "meta" / "time.csv"
    start = formats.T0_NS / 1e9
    times.write_text(times.read_text().replace('"PAUSE",1E3', f'"START",1.0,{start + 61:.3f},"again"\n"PAUSE",1E3'))
    ended = run(export)
    t_s = ended.column("imu", "t_s")
    assert max(after - before for before, after in pairwise(t_s)) == pytest.approx(60.01)


def test_an_export_of_phyphox_without_its_times_counts_from_the_start(run: Import, drive: Recording) -> None:
    export = formats.phyphox(run.folder / "export", drive)
    (export / "meta" / "time.csv").unlink()
    assert "its times count from the start of the experiment" in run(export).printed


def test_the_barometer_of_a_phone_is_a_pressure_in_pa(run: Import, drive: Recording) -> None:
    phyphox = run(formats.phyphox(run.folder / "export", drive, ";", comma=True))
    logger = run(formats.sensor_logger(run.folder / "phone.zip", drive, platform="android"), out="logger")
    for ended in (phyphox, logger):
        assert ended.column("pressure", "pressure_pa") == pytest.approx([100.0 * formats.PRESSURE_HPA] * 20)
        assert ended.column("pressure", "t_s") == pytest.approx(list(drive.imu["t_s"][::10]), abs=1e-9)
        assert "98725 to 98725 Pa" in ended.printed


@pytest.mark.parametrize("platform", [None, "ios"])
def test_an_iphone_has_its_accelerations_turned_round(run: Import, drive: Recording, platform: str | None) -> None:
    ended = run(formats.sensor_logger(run.folder / "phone.zip", drive, ios=True, platform=platform))
    assert worst(ended, drive) < 1e-8
    assert ("accelerations of an iPhone: their sign is turned round" in ended.printed) is (platform == "ios")
    assert ("gravity tells the sign" in ended.printed) is (platform is None)


@pytest.mark.parametrize("platform", [None, "android"])
def test_an_android_phone_keeps_its_signs(run: Import, drive: Recording, platform: str | None) -> None:
    ended = run(formats.sensor_logger(run.folder / "phone.zip", drive, platform=platform))
    assert worst(ended, drive) < 1e-8
    assert "not used: Location.csv" in ended.printed


def test_the_signs_can_be_told(run: Import, drive: Recording) -> None:
    ended = run(formats.sensor_logger(run.folder / "phone.zip", drive, ios=True), "--signs", "android")
    assert ended.column("imu", "az")[0] == pytest.approx(-drive.imu["az"][0])


def test_a_folder_is_as_good_as_a_zip(run: Import, drive: Recording, tmp_path: Path) -> None:
    import zipfile

    with zipfile.ZipFile(formats.sensor_logger(run.folder / "phone.zip", drive)) as archive:
        archive.extractall(tmp_path / "phone")
    (tmp_path / "phone" / ".DS_Store").write_bytes(b"\0\0")
    assert worst(run(tmp_path / "phone"), drive) < 1e-8


def header(*names: str) -> str:
    return ",".join(f'"{name}"' for name in names) + "\n"


ACC = header("Time (s)", *(f"Acceleration {axis} (m/s^2)" for axis in "xyz"))
LINEAR = ACC.replace("Acceleration", "Linear Acceleration")
GYRO = header("Time (s)", *(f"Gyroscope {axis} (rad/s)" for axis in "xyz"))
ROWS = "".join(f"{i / 100:.2E},1E-2,2E-2,9.81E0\n" for i in range(30))
LOGGER = "time,seconds_elapsed,z,y,x\n"


@pytest.mark.parametrize(
    ("files", "sentence"),
    [
        ({"Accelerometer.csv": ACC + ROWS}, "has no readings of the gyroscope: record it, too"),
        ({"Gyroscope.csv": GYRO + ROWS}, "has no accelerations: record the acceleration with gravity"),
        ({"a.csv": LINEAR + ROWS, "g.csv": GYRO + ROWS}, "has accelerations without gravity only"),
        ({"Gyroscope.csv": ACC + ROWS, "Accelerometer.csv": ACC + ROWS}, "the columns of Gyroscope.csv are Time (s)"),
        ({"Gyroscope.csv": LOGGER + "1,0,0,0,0\n", "Gravity.csv": LOGGER + "1,0,0,0,0\n"}, "has no accelerations"),
        (
            dict.fromkeys(
                ("Gyroscope.csv", "Gravity.csv", "Accelerometer.csv"), LOGGER + "1760000000000000000,0,0,1,0\n"
            ),
            "--signs ios or --signs android",
        ),
    ],
)
def test_an_export_that_lacks_something_says_what_to_record(run: Import, files: dict[str, str], sentence: str) -> None:
    ended = run(formats.zipped(run.folder / "phone.zip", files))
    assert ended.status == 2
    assert sentence in ended.error
    assert not ended.out.exists()


def test_readings_that_are_no_numbers_are_left_out(run: Import) -> None:
    files = {"Accelerometer.csv": ACC + ROWS + "3.0E-1,,NaN,1\n", "Gyroscope.csv": GYRO + ROWS + "soon,1,2,3\n"}
    ended = run(formats.zipped(run.folder / "phone.zip", files))
    assert "Accelerometer.csv: 1 left out: a value is not a number (line 32)" in ended.printed
    assert math.isclose(ended.column("imu", "az")[0], 9.81)

"""Usual names of columns are known, with the units in them; others are not taken for readings."""

import pytest

from dropanchor_service.importing.readings import ImportingError
from dropanchor_service.importing.tables.guess import guessed

AXES = ("ax", "ay", "az", "gx", "gy", "gz")


def words(*columns: str, table: str = "") -> list[str]:
    return [f"{field}={column}" for field, column in guessed(columns, table).items()]


def of_vectors(acc: str, gyro: str) -> list[str]:
    """Return the columns that the patterns give for x, y and z."""
    return [pattern.format(axis) for pattern in (acc, gyro) for axis in "xyz"]


@pytest.mark.parametrize(
    ("acc", "gyro"),
    [
        ("a{}", "g{}"),
        ("a{}", "w{}"),
        ("acc_{}", "gyr_{}"),
        ("acc_{}", "gyro_{}"),
        ("accel_{}", "omega_{}"),
        ("acc.{}", "gyro.{}"),
        ("accelerometer_{}", "gyroscope_{}"),
        ("Accelerometer {}", "Gyroscope {}"),
        ("accel{}", "gyro{}"),
        ("imu_acc_{}", "imu_gyro_{}"),
        ("linear_acceleration.{}", "angular_velocity.{}"),
        ("field.linear_acceleration.{}", "field.angular_velocity.{}"),
        ("a_RS_S_{}", "w_RS_S_{}"),
        ("{}acc", "{}gyro"),
        ("{}_acc", "{}_gyro"),
    ],
)
def test_usual_spellings_of_an_imu_are_known(acc: str, gyro: str) -> None:
    columns = of_vectors(acc, gyro)
    assert words("time", *columns, "temperature") == ["t=time", *map("{}={}".format, AXES, columns)]


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("acc_{} [g]", "g"),
        ("acc_{} (m/s^2)", "m/s^2"),
        ("Acceleration {} (m/s²)", "m/s²"),
        ("acc_{}_mg", "mg"),
        ("acc_{}_m_s2", "ms2"),
        ("a_RS_S_{} [m s^-2]", "m s^-2"),
    ],
)
def test_a_unit_in_the_name_is_used(name: str, unit: str) -> None:
    columns = [name.format(axis) for axis in "xyz"]
    assert words(*columns) == [f"a{axis}={column}:{unit}" for axis, column in zip("xyz", columns, strict=True)]


@pytest.mark.parametrize("name", ["gyro_{}_dps", "gyro {} (°/s)", "gyro_{} [deg/s]", "gyro_{}_deg_s", "gyr_{}_degps"])
def test_turn_rates_in_degrees_are_known(name: str) -> None:
    found = guessed([name.format(axis) for axis in "xyz"])
    assert list(found) == ["gx", "gy", "gz"]
    assert all(column.unit for column in found.values())


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        (("t", "r"), ["t=t", "range=r"]),
        (
            ("timestamp_ms", "anchor_id", "distance_mm"),
            ["t=timestamp_ms:ms", "anchor=anchor_id", "range=distance_mm:mm"],
        ),
        (
            ("time (s)", "beacon", "dist_cm", "sigma_cm"),
            ["t=time (s):s", "anchor=beacon", "range=dist_cm:cm", "std=sigma_cm:cm"],
        ),
        (("ts", "uwb_range", "uwb_rssi"), ["t=ts", "range=uwb_range"]),
        (("micros", "d0", "d1"), ["t=micros:us", "range.0=d0", "range.1=d1"]),
        (("time", "dist_A1 [m]", "dist_A2 [m]"), ["t=time", "range.A1=dist_A1 [m]:m", "range.A2=dist_A2 [m]:m"]),
        (("timestamp", "id", "range"), ["t=timestamp", "anchor=id", "range=range"]),
        (("time", "yaw_deg", "range"), ["t=time", "range=range", "heading=yaw_deg:deg"]),
        (
            ("header.stamp.sec", "header.stamp.nanosec", "range"),
            ["t=header.stamp.sec:sec", "t_nsec=header.stamp.nanosec", "range=range"],
        ),
        (("time", "seconds_elapsed", "range"), ["t=time", "range=range"]),
    ],
)
def test_usual_spellings_of_ranges_and_times_are_known(columns: tuple[str, ...], expected: list[str]) -> None:
    assert words(*columns) == expected


def test_accelerations_with_gravity_come_before_those_without() -> None:
    linear = [f"linear_acc_{axis}" for axis in "xyz"]
    assert words(*linear, "acc_x", "acc_y", "acc_z") == ["ax=acc_x", "ay=acc_y", "az=acc_z"]
    assert words(*linear) == [f"a{axis}=linear_acc_{axis}" for axis in "xyz"]


def test_the_name_of_the_table_tells_what_x_y_and_z_are() -> None:
    assert words("t", "x", "y", "z", table="gyro.csv") == ["t=t", "gx=x", "gy=y", "gz=z"]
    assert words("t", "x", "y", "z", table="path.csv") == ["t=t"]


@pytest.mark.parametrize(
    "column",
    [
        "orientation.x",
        "gyro_bias_x",
        "position_x",
        "range_std_max",
        "field_of_view",
        "max_range",
        "gravity_x",
        "acc_cov_x",
    ],
)
def test_other_columns_are_no_readings(column: str) -> None:
    assert words(column, column.replace("_x", "_y"), column.replace("_x", "_z")) == []


def test_the_heading_of_a_truth_is_no_reading_of_the_tag() -> None:
    assert words("t_s", "x", "y", "z", "yaw_rad") == ["t=t_s:s"]


def test_a_vector_without_one_of_its_axes_is_none() -> None:
    assert words("t", "ax", "ay", "range") == ["t=t", "range=range"]


def test_a_unit_that_is_not_known_is_named_with_what_to_write() -> None:
    with pytest.raises(ImportingError, match=r"'acc_x \[LSB\]' has the unit 'LSB'.*'ax=acc_x \[LSB\]:m/s2'"):
        guessed(["t", "acc_x [LSB]", "acc_y [LSB]", "acc_z [LSB]"])

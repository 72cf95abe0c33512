"""ROS messages against a reader and a writer of CDR that were written apart from them."""

from contextlib import suppress
from math import isnan, nan, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_service.bridges.rmw_zenoh import NO_TYPE_HASH
from dropanchor_service.bridges.ros_messages import RosMessages, UnusableError, is_usable
from support.ros2 import (
    HEADER,
    IMU,
    ODOMETRY,
    POSE,
    PRESSURE,
    RANGE,
    TF,
    CdrReader,
    CdrWriter,
    imu_cdr,
    pressure_cdr,
    range_cdr,
    read_pose,
)

T_NS = 1_800_000_000_123_456_789
COVARIANCE = [[0.1, 0.02, 0.03], [0.02, 0.4, 0.05], [0.03, 0.05, 0.6]]
MESSAGES = RosMessages()


def pose(**fields: Any) -> dict[str, Any]:
    known = {"frame": "site", "x": 1.0, "y": -2.0, "heading_rad": -3 * pi / 4, "covariance": COVARIANCE}
    return {"tag": "cart", "t_ns": T_NS, "state": "tracking", "speed_mps": 1.5, "yaw_rate_radps": 0.25} | known | fields


def test_the_types_have_the_names_and_hashes_of_ros_2_jazzy() -> None:
    types = (MESSAGES.imu, MESSAGES.range, MESSAGES.pressure, MESSAGES.pose, MESSAGES.odometry, MESSAGES.tf)
    assert [f"{of.dds_name}/{of.type_hash}" for of in types] == [IMU, RANGE, PRESSURE, POSE, ODOMETRY, TF]


def test_a_pose_has_the_covariance_of_x_y_and_yaw_in_their_places() -> None:
    reader = CdrReader(MESSAGES.pose_cdr(pose(), 0.5))
    assert reader.stamp_and_frame() == (T_NS, "site")
    place, heading, covariance = read_pose(reader)
    reader.end()
    assert place == [1.0, -2.0, 0.5]
    assert heading == pytest.approx(-3 * pi / 4)
    matrix = np.array(covariance).reshape(6, 6)
    np.testing.assert_array_equal(matrix[np.ix_([0, 1, 5], [0, 1, 5])], COVARIANCE)
    np.testing.assert_array_equal(matrix[2:5, 2:5], np.diag([1e6, 1e6, 1e6]))
    assert not matrix[np.ix_([0, 1, 5], [2, 3, 4])].any()


def test_a_height_that_was_measured_has_a_variance_and_one_that_was_told_has_none() -> None:
    for source, variance in (("pressure", 0.0625), ("told", 1e6), ("unknown", 1e6)):
        reader = CdrReader(MESSAGES.pose_cdr(pose(z=6.5, z_std_m=0.25, z_source=source), 6.5))
        reader.stamp_and_frame()
        place, _, covariance = read_pose(reader)
        assert (place[2], covariance[2 * 6 + 2]) == (6.5, variance)


def test_odometry_moves_in_the_frame_of_the_tag() -> None:
    reader = CdrReader(MESSAGES.odometry_cdr(pose(), 0.5, "cart/base_link"))
    assert (reader.stamp_and_frame()[1], reader.text()) == ("site", "cart/base_link")
    read_pose(reader)
    assert reader.take("d", 6) == [1.5, 0.0, 0.0, 0.0, 0.0, 0.25]
    assert reader.take("d", 36) == [1e6 if row == column else 0.0 for row in range(6) for column in range(6)]
    reader.end()


@pytest.mark.parametrize(
    "fields",
    [
        *({"state": state} for state in ("lost", "ambiguous", "relative")),
        {"frame": "relative"},  # as a service before the state `relative` says it, which gives x and y
        *({name: None} for name in ("x", "heading_rad", "covariance")),
    ],
)
def test_a_robot_gets_no_pose_that_it_must_not_act_on(fields: dict[str, Any]) -> None:
    assert is_usable(pose())
    assert not is_usable(pose(**fields))


def test_samples_have_the_values_and_the_stamp_of_their_message() -> None:
    imu = MESSAGES.imu_sample(imu_cdr(T_NS, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)), 5, MESSAGES.imu.type_hash)
    assert imu == (T_NS, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), None)
    distance = MESSAGES.range_sample(range_cdr(T_NS, 3.5, variance=0.0625), 5, "7", MESSAGES.range.type_hash)
    assert distance == (T_NS, 7, 3.5, 0.25)


def test_a_message_without_stamp_or_variance_has_the_time_of_its_sending_and_an_unknown_deviation() -> None:
    sample = MESSAGES.range_sample(range_cdr(0, 3.5, variance=0.0), T_NS, "yard", MESSAGES.range.type_hash)
    assert sample.t_ns == T_NS
    assert isnan(sample.std_m)


def test_a_sensor_without_limits_may_report_any_range() -> None:
    assert MESSAGES.range_sample(range_cdr(T_NS, 3.5, max_range=0.0), 0, "7", MESSAGES.range.type_hash).range_m == 3.5


@given(st.binary(max_size=400) | st.binary(max_size=400).map(lambda body: HEADER + body))
def test_any_bytes_are_a_sample_or_unusable(cdr: bytes) -> None:
    for imu_hash, range_hash in ((MESSAGES.imu.type_hash, MESSAGES.range.type_hash), (NO_TYPE_HASH, NO_TYPE_HASH)):
        with suppress(UnusableError):
            assert len(MESSAGES.imu_sample(cdr, T_NS, imu_hash).acc) == 3
        with suppress(UnusableError):
            assert MESSAGES.range_sample(cdr, T_NS, "7", range_hash).anchor == 7


def test_messages_of_humble_are_read_without_the_variance_that_it_does_not_have() -> None:
    cdr = CdrWriter().header(T_NS, "uwb").add("B", 0).add("f", 0.1, 0.0, 100.0, 3.5).cdr
    assert MESSAGES.range_sample(cdr, 5, "7", NO_TYPE_HASH)[:3] == (T_NS, 7, 3.5)
    imu = MESSAGES.imu_sample(imu_cdr(T_NS, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)), 5, NO_TYPE_HASH)
    assert imu == (T_NS, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), None)
    with pytest.raises(UnusableError, match="a damaged sensor_msgs/msg/Range"):
        MESSAGES.range_sample(cdr, 5, "7", MESSAGES.range.type_hash)


@pytest.mark.parametrize(
    ("cdr", "type_hash", "why"),
    [
        (imu_cdr(T_NS, (0, 0, 9.8), (0, 0, 0), covariance=-1.0), MESSAGES.imu.type_hash, "without angular_velocity"),
        (imu_cdr(T_NS, (0, 0, 0), (0, 0, 0.1)), MESSAGES.imu.type_hash, "0 along all axes: it was not measured"),
        (imu_cdr(T_NS, (0, -0.0, 0), (0, 0, 0)), NO_TYPE_HASH, "0 along all axes: it was not measured"),
        (imu_cdr(T_NS, (0, 0, 9.8), (0, 0, 0)), "RIHS01_00", "other fields than in ROS 2 Humble and Jazzy"),
    ],
)
def test_an_imu_message_without_a_measurement_is_named(cdr: bytes, type_hash: str, why: str) -> None:
    with pytest.raises(UnusableError, match=why):
        MESSAGES.imu_sample(cdr, T_NS, type_hash)


@pytest.mark.parametrize("type_hash", [MESSAGES.pressure.type_hash, NO_TYPE_HASH], ids=["Jazzy", "Humble"])
def test_a_barometer_gives_pascals(type_hash: str) -> None:
    sample = MESSAGES.pressure_sample(pressure_cdr(T_NS, 101_325.0), 5, type_hash)
    assert sample[:2] == (T_NS, 101_325.0)
    with pytest.raises(UnusableError, match="a pressure that is not finite"):
        MESSAGES.pressure_sample(pressure_cdr(T_NS, nan), 5, type_hash)

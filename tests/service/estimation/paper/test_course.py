"""The direction of travel, and the detection of straight lines."""

import math

import pytest

from dropanchor_service.estimation.columns import HeadingSource, default_settings
from dropanchor_service.estimation.paper.course import Course
from dropanchor_service.estimation.paper.parameters import PaperParameters
from dropanchor_service.estimation.paper.tag import Tag

UP = (0.0, 0.0, 9.80665)
NORTH = (0.0, 20.0, -44.0)  # µT, as a body that looks east sees it
NO_FIELD = (math.nan,) * 3


def course(**changes: object) -> Course:
    settings = default_settings()
    for name, value in changes.items():
        settings[name] = value
    return Course(PaperParameters(), Tag.of(settings))


@pytest.mark.parametrize(("rate", "straight"), [(0.0, True), (0.05, True), (0.3, False), (-0.3, False)])
def test_with_a_gyroscope_a_line_is_straight_while_the_mean_turn_rate_is_small(rate: float, straight: bool) -> None:
    made = course()
    for i in range(20):
        noise = 0.2 if i % 2 else -0.2  # single samples are beyond the threshold
        made.take_imu(10_000_000 * i, UP, (0.0, 0.0, rate + noise), NO_FIELD)
    assert made.straight(0.0) is straight


def test_rolling_and_pitching_is_not_turning() -> None:
    made = course()
    for i in range(20):
        made.take_imu(10_000_000 * i, UP, (1.0 if i % 2 else -1.0, 0.8, 0.0), NO_FIELD)
    assert made.straight(0.0)


def test_without_a_gyroscope_a_line_is_straight_while_the_course_stays_near_where_it_began() -> None:
    made = course()
    assert not made.straight(3.1)  # the first begins a line
    assert made.straight(3.14)
    assert made.straight(-3.12)  # across pi
    assert not made.straight(-3.05)
    assert made.straight(-3.0)  # of the line that began at -3.05


def test_auto_takes_the_platform_until_the_imu_has_found_north() -> None:
    made = course(heading_source=HeadingSource.AUTO)
    assert not made.any_heading
    made.take_imu(0, UP, (0.0, 0.0, 0.0), NO_FIELD)
    assert made.any_heading
    assert made.newest is None
    made.take_platform(1, 1.5)
    assert made.newest == (1, 1.5)
    made.take_imu(2, UP, (0.0, 0.0, 0.0), NORTH)
    assert made.newest == (2, pytest.approx(0.0))


def test_imu_never_takes_the_platform_and_platform_never_the_imu() -> None:
    imu, platform = course(heading_source=HeadingSource.IMU), course(heading_source=HeadingSource.PLATFORM)
    for made in (imu, platform):
        made.take_platform(0, 1.5)
    assert imu.newest is None
    imu.take_imu(1, UP, (0.0, 0.0, 0.0), NORTH)
    platform.take_imu(1, UP, (0.0, 0.0, 0.0), NORTH)
    assert imu.newest == (1, pytest.approx(0.0))
    assert platform.newest == (0, 1.5)

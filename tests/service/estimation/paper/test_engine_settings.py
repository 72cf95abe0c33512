"""The settings of a tag in the engine `paper`."""

import math
import subprocess
import sys

import pytest

from dropanchor_service.estimation.columns import (
    HeadingSource,
    SampleBatch,
    anchors_at,
)
from dropanchor_service.estimation.paper.engine import PaperEngine
from dropanchor_service.estimation.paper.parameters import TUNED
from service.estimation.paper.one_row import engine, headings, imu, ranges, start


def test_a_mounting_angle_turns_the_course_and_not_the_published_heading() -> None:
    made = engine(start(mount_angle=math.pi / 2, start_y=-10.0))
    for i in range(80):  # the body looks east, the tag moves north
        made.process(headings((i * 0.1, 0.0)))
        poses = made.process(ranges((i * 0.1, math.hypot(10.0, 0.1 * i - 10)))).poses
    assert poses["heading"][0] == pytest.approx(0.0, abs=0.05)
    assert poses["x"][0] == pytest.approx(10.0, abs=0.3)
    assert poses["y"][0] == pytest.approx(0.1 * 79 - 10, abs=1.0)


def test_the_heading_of_the_start_is_of_the_body_too() -> None:
    made = engine(start(mount_angle=1.0, start_heading=2.0))
    made.process(imu(0.0))
    assert made.process(ranges((0.0, 10.0))).poses["heading"][0] == pytest.approx(2.0)
    assert float(made._filters[0]._ekf.x[2]) == pytest.approx(3.0)  # type: ignore[union-attr]


def test_the_noise_of_a_range_is_the_samples_own_else_the_tags_else_the_default() -> None:
    def pulled(tag_std: float, sample_std: float) -> float:
        made = engine(start(range_std=tag_std))
        made.process(headings((0, 0.0)))
        sample = ranges((0, 10.1))
        sample.ranges["std"] = sample_std
        return float(made.process(sample).poses["x"][0]) - 10

    assert pulled(math.nan, math.nan) == pytest.approx(0.1 * 0.1**2 / (0.1**2 + TUNED.range_std**2))
    assert pulled(0.3, math.nan) == pytest.approx(0.1 * 0.1**2 / (0.1**2 + 0.3**2))
    assert pulled(0.3, 0.5) == pytest.approx(0.1 * 0.1**2 / (0.1**2 + 0.5**2))


def test_while_ranges_are_missing_the_attitude_steers_the_belief_through_a_turn() -> None:
    """A tag at a steady 1 m/s turns left by a right angle in three seconds without a range."""
    made = engine(start(start_heading=0.0))
    made.process(imu(0.0))
    made.process(ranges((0.0, 10.0)))
    belief = made._filters[0]._ekf
    assert belief is not None
    belief.x[3] = 1.0
    turn = imu(*(0.02 * i for i in range(1, 151)))
    turn.imu["gyro"][:, 2] = math.pi / 2 / 3
    made.process(turn)
    radius = 3 / (math.pi / 2)
    assert belief.x[:2] == pytest.approx([10 + radius, radius], abs=0.15)


def test_an_attitude_is_fused_once_however_many_ranges_come_before_the_next() -> None:
    made = engine(start(start_heading=0.0))
    made.process(imu(0.0))
    made.process(ranges(*((0.001 * i, 10.0) for i in range(50))))
    belief = made._filters[0]._ekf
    assert belief is not None
    once = 1 / (1 / TUNED.start_heading_std**2 + 1 / TUNED.heading_std**2)
    assert belief.P[2, 2] > once


def test_height_bias_and_scale_of_the_range_are_taken_out() -> None:
    made = PaperEngine(TUNED)
    made.set_anchors(anchors_at((1.0, 2.0, 5.0)))
    made.configure(0, start(height=1.0, range_scale=1.05, range_bias=0.3, start_std=5.0))
    made.process(headings((0, 0.0)))
    true = math.sqrt(9.0**2 + 2.0**2 + 4.0**2)
    poses = made.process(ranges(*((0.01 * i, 1.05 * true + 0.3) for i in range(100)))).poses
    x, y = poses["x"][-1] - 1, poses["y"][-1] - 2
    assert math.sqrt(x * x + y * y + 16) == pytest.approx(true, abs=0.01)
    assert poses["range"][-1] == pytest.approx(1.05 * true + 0.3)


@pytest.mark.parametrize(
    ("source", "expected"), [(HeadingSource.AUTO, 0.0), (HeadingSource.IMU, 0.0), (HeadingSource.PLATFORM, 2.0)]
)
def test_the_heading_comes_from_the_source_that_is_set(source: HeadingSource, expected: float) -> None:
    made = engine(start(heading_source=source))
    made.process(SampleBatch(imu=imu(0, 0.01, mag=(0, 20, -44)).imu, headings=headings((0, 2.0)).headings))
    assert made.process(ranges((0.1, 10.0))).poses["heading"][0] == pytest.approx(expected, abs=0.01)


def test_filterpy_is_imported_only_with_the_engine_that_needs_it() -> None:
    code = "import sys, dropanchor_service.estimation.columns; sys.exit(any('filterpy' in m for m in sys.modules))"
    path = {"PYTHONPATH": ":".join(sys.path)}
    assert subprocess.run([sys.executable, "-c", code], env=path, check=False).returncode == 0

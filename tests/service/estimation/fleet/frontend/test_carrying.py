"""The yaw of a carried device, which may be upright, and the direction of its steps."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import Motion
from dropanchor_service.estimation.fleet.frontend.carrying import (
    CARRYING,
    carried_yaw,
    refer_up,
    start_carrying,
    yaw_of_carried,
)
from dropanchor_service.estimation.fleet.frontend.gait import STRIDE, add_stride_sample, stride_direction


def product(a: Any, b: Any) -> Any:
    """Hamilton product of two quaternions (w, x, y, z)."""
    v = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *v])


def about(axis: int, angle: float) -> Any:
    q = np.zeros(4)
    q[0], q[1 + axis] = math.cos(angle / 2), math.sin(angle / 2)
    return q


HOLDS = {
    "level": about(0, 0.0),
    "upright": about(1, -math.pi / 2),
    "head down": about(1, math.pi / 2),
    "on its side": about(0, math.pi / 2),
    "screen down": about(0, math.pi),
    "tilted": product(about(1, 0.7), about(0, -0.9)),
}


@pytest.mark.parametrize("hold", HOLDS)
def test_a_turn_about_the_vertical_is_a_turn_of_the_yaw_however_the_device_is_held(hold: str) -> None:
    c = np.zeros(1, CARRYING)[0]
    start_carrying(c, 9.81, Motion.CARRIED)
    refer_up(c, HOLDS[hold])
    angles = np.linspace(0.0, 3.0, 31)
    yaws = np.unwrap([carried_yaw(c, product(about(2, angle), HOLDS[hold])) for angle in angles])
    np.testing.assert_allclose(yaws - yaws[0], angles, atol=1e-9)


def test_the_yaw_of_a_level_device_is_the_azimuth_of_its_x_axis() -> None:
    c = np.zeros(1, CARRYING)[0]
    start_carrying(c, 9.81, Motion.CARRIED)
    refer_up(c, about(2, 0.4))
    assert carried_yaw(c, about(2, 1.1)) == pytest.approx(1.1)


def test_the_yaw_goes_on_where_the_device_is_turned_over() -> None:
    c = np.zeros(1, CARRYING)[0]
    start_carrying(c, 9.81, Motion.CARRIED)
    refer_up(c, about(0, 0.0))
    yaws = [yaw_of_carried(c, product(about(2, 0.5), about(0, roll))) for roll in np.linspace(0.0, math.pi, 60)]
    np.testing.assert_allclose(yaws, 0.5, atol=1e-9)


@pytest.mark.parametrize("course", [0.3, 2.0, -2.8])
def test_steps_push_forward_while_the_upward_acceleration_grows(course: float) -> None:
    d, dt = np.zeros(1, STRIDE)[0], 0.02
    for t in np.arange(0.0, 6.0, dt):
        phase = 2 * math.pi * 1.8 * t
        forward, up = -0.8 * math.sin(phase), 3.0 * math.cos(phase)
        add_stride_sample(d, dt, forward * math.cos(course), forward * math.sin(course), up)
    azimuth, coherence = stride_direction(d)
    assert azimuth == pytest.approx(course, abs=0.02)
    assert coherence > 0.95

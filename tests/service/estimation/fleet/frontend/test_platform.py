"""The headings of a platform beside an IMU, which the gyroscope carries to the end of a node."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import Motion
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.frontend.carrying import carried_yaw, refer_up
from dropanchor_service.estimation.fleet.frontend.platform import (
    PLATFORM,
    add_reading,
    refer_readings,
    use_platform_heading,
)
from dropanchor_service.estimation.fleet.frontend.state import FRONTEND, start_at, start_frontend
from support.belief import node_of

UPRIGHT = np.array([math.cos(math.pi / 4), 0.0, -math.sin(math.pi / 4), 0.0])  # body x points up
HEADING = 0.7  # rad


def upright_device() -> Any:
    """Return the front-end of a device that is held upright and was just picked up."""
    front = np.zeros(1, FRONTEND)[0]
    start_frontend(front, 1.0, 0.0, int(Motion.CARRIED))
    start_at(front, 1, np.array([9.81, 0.0, 0.0]), np.zeros(3))
    front["carrying"]["carried"] = 1
    front["attitude"]["q"] = UPRIGHT
    refer_up(front["carrying"], UPRIGHT)
    return front


def swung(angle: float) -> Any:
    """Return the attitude of that device, leant to the side by an angle, rad."""
    c, s = math.cos(angle / 2), math.sin(angle / 2)
    w, x, y, z = UPRIGHT
    return np.array([c * w - s * x, c * x + s * w, c * y - s * z, c * z + s * y])


def test_a_reading_of_an_upright_device_is_carried_by_the_yaw_that_the_node_tells() -> None:
    front, platform, node = upright_device(), np.zeros(1, PLATFORM)[0], node_of()
    for k, angle in enumerate([-0.2, 0.1, 0.2, 0.3]):
        front["attitude"]["q"] = swung(angle)
        add_reading(platform, front, k + 1, HEADING, math.nan)
    front["preintegration"]["yaw_end"] = carried_yaw(front["carrying"], front["attitude"]["q"])
    use_platform_heading(platform, front, node)
    assert wrap(node["heading"] - HEADING) == pytest.approx(0.0, abs=0.05)


def test_the_last_reading_counts_where_another_yaw_begins() -> None:
    front, platform, node = upright_device(), np.zeros(1, PLATFORM)[0], node_of()
    front["carrying"]["carried"] = 0
    for k, angle in enumerate([-0.3, 0.2]):
        front["attitude"]["q"] = swung(angle)
        add_reading(platform, front, k + 1, HEADING, 0.1)
    front["preintegration"]["yaw_end"] = 2.0
    refer_readings(platform, front)
    use_platform_heading(platform, front, node)
    assert (node["heading"], node["heading_var"]) == pytest.approx((HEADING, 0.01))

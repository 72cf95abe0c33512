"""The headings of a platform (a robot, a phone), alone or beside an IMU.

Alone, the yaw increment of a node is the increment of the heading, extrapolated to the node's end with its last rate.
Beside an IMU, the gyroscope carries every reading to the node's end, where the readings are averaged.
"""

import math
from typing import Any, TypeAlias

import numpy as np

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.attitude import yaw_of
from dropanchor_service.estimation.fleet.frontend.carrying import carried_yaw
from dropanchor_service.estimation.fleet.frontend.node import (
    DERIVED_HEADING,
    MEASURED_HEADING,
    NO_HEADING,
    NOT_MOVED,
    RESTING,
    Node,
)
from dropanchor_service.estimation.fleet.frontend.state import Frontend

PLATFORM = np.dtype(
    [
        ("reading_count", "u1"),  # readings so far: 0, 1, or 2 for more
        ("t_heading", "i8"),  # ns, of the last reading
        ("heading", "f8"),
        ("rate", "f8"),  # rad/s, between the last two readings
        ("std", "f8"),  # rad, of the last reading, NaN: not told
        ("t_node", "i8"),  # ns, end of the last node
        ("node_heading", "f8"),
        ("gyro_offset", "f8"),  # rad, mean of reading minus the gyroscope's yaw, of this node's readings
        ("readings", "i4"),
        ("moved", "u1"),  # 1: the tag has moved since the start
        ("first_ranges", "i4"),
        ("first_range", "f8"),  # m, mean of the first ranges
    ]
)
Platform: TypeAlias = Any  # a record of PLATFORM

NOISE = 1.6e-5  # rad^2/s, of a platform's increments
READING_STD = 0.1  # rad, of a reading whose std is not told
EXTRAPOLATE = 0.25  # s
WANDER = 2.0  # m^2/s, of each coordinate of a tag of which only ranges are known
TURN = 1.0  # rad^2/s, of its heading
STILL_RATE = 0.03  # rad/s
STILL_RANGES = 5  # ranges that agree with a tag that stands


@njit(nogil=True)
def add_reading(p: Platform, front: Frontend, t_ns: int, heading: float, std: float) -> None:
    """Take one reading of the platform's heading, rad, with its standard deviation or NaN."""
    if p.reading_count > 0 and t_ns > p.t_heading:
        p.rate = wrap(heading - p.heading) / max((t_ns - p.t_heading) * 1e-9, 1e-3)
        p.reading_count = 2
    if p.reading_count == 0:
        p.reading_count = 1
        p.t_node = t_ns
        p.node_heading = heading
    p.t_heading, p.heading, p.std = t_ns, heading, std
    if front.running == 1:
        q, c = front.attitude.q, front.carrying
        lead = wrap(heading - (carried_yaw(c, q) if c.carried == 1 else yaw_of(q)))  # as `close_node` tells the yaw
        p.readings += 1
        p.gyro_offset += wrap(lead - p.gyro_offset) / p.readings


@njit(nogil=True)
def fill_platform_node(p: Platform, t_ns: int, node: Node) -> None:
    """Fill a node from the platform alone: no acceleration, and yaw from the increments of the heading."""
    node.dv_var = node.heading_var = math.inf
    if p.reading_count == 0:
        _wander(p, t_ns, node)
        return
    ahead = (t_ns - p.t_heading) * 1e-9
    heading = wrap(p.heading + p.rate * max(min(ahead, EXTRAPOLATE), -EXTRAPOLATE))
    node.dt_s = max((t_ns - p.t_node) * 1e-9, 0.0)
    node.dyaw = wrap(heading - p.node_heading)
    node.dyaw_var = NOISE * node.dt_s + 1e-7 + (0.5 * max(ahead - 2.0 * EXTRAPOLATE, 0.0)) ** 2
    node.unobserved_s = node.dt_s if ahead > 2.0 * EXTRAPOLATE else 0.0
    std = p.std if math.isfinite(p.std) else 0.02
    node.heading, node.heading_var, node.heading_kind = heading, std * std, DERIVED_HEADING
    p.t_node, p.node_heading = t_ns, heading


@njit(nogil=True)
def _wander(p: Platform, t_ns: int, node: Node) -> None:
    """Fill a node of which nothing is known but its time: the tag wanders, and has no speed or course to follow."""
    if p.t_node > 0:
        node.dt_s = max((t_ns - p.t_node) * 1e-9, 0.0)
    node.rest, node.dyaw_var, node.wander_var = RESTING, TURN * node.dt_s, WANDER * node.dt_s
    p.t_node = t_ns


@njit(nogil=True)
def detect_first_motion(p: Platform, node: Node, z: float, std: float) -> None:
    """Mark the node as not moved until range or heading show that a tag has left its known start."""
    if p.moved == 1:
        return
    if math.isfinite(z):
        if p.first_ranges < STILL_RANGES:
            p.first_ranges += 1
            p.first_range += (z - p.first_range) / p.first_ranges
        elif abs(z - p.first_range) > 4.0 * std:
            p.moved = 1
    if node.dt_s > 0.0 and abs(node.dyaw) > STILL_RATE * node.dt_s + 1e-4:
        p.moved = 1
    if p.moved == 0 and node.dt_s > 0.0:
        node.rest = NOT_MOVED


@njit(nogil=True)
def refer_readings(p: Platform, front: Frontend) -> None:
    """Refer the readings of a node to the yaw at its end, by the last of them: another yaw begins there."""
    p.readings = min(p.readings, 1)
    p.gyro_offset = wrap(p.heading - front.preintegration.yaw_end)


@njit(nogil=True)
def use_platform_heading(p: Platform, front: Frontend, node: Node) -> None:
    """Replace the heading of an IMU node by the mean of the platform's readings in it, or by none."""
    if p.readings == 0:
        node.heading_kind = NO_HEADING
        return
    std = p.std if math.isfinite(p.std) and p.std > 0.0 else READING_STD
    node.heading = wrap(front.preintegration.yaw_end + p.gyro_offset)
    node.heading_var = std * std / p.readings
    node.heading_kind = MEASURED_HEADING
    node.unobserved_s = 0.0
    p.readings = 0
    p.gyro_offset = 0.0

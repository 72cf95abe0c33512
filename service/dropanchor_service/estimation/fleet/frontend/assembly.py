"""One compiled pass that turns ordered samples of many rows into nodes.

A tag on a mast, or held out in front, is a lever (x, y), body frame, away from the pivot (a rear axle, a person's feet)
that moves along the course, and swings about it when that turns. With w the rate and R(a) a turn by a, over a node:

    swing = (R(dyaw) - I) lever,   dv of the pivot = dv of the tag - (R(dyaw) w x lever at the end - w x lever before).

Rates are means over a node. The state is the place of the tag and the speed of the pivot.
"""

import math
from typing import Any, Final

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.event import HEADING_EVENT, PRESSURE_EVENT, Event
from dropanchor_service.estimation.fleet.frontend.height import add_pressure, height_at
from dropanchor_service.estimation.fleet.frontend.inertial import add_sample, close_node
from dropanchor_service.estimation.fleet.frontend.node import NO_HEADING, RANGE, Node, Nodes
from dropanchor_service.estimation.fleet.frontend.platform import (
    Platform,
    add_reading,
    detect_first_motion,
    fill_platform_node,
    refer_readings,
    use_platform_heading,
)
from dropanchor_service.estimation.fleet.frontend.state import Frontend

MAX_NODE_NS: Final = 150_000_000  # ns, of a node: with ranges at 10 Hz, every node ends with one
AUTO, IMU_ONLY, PLATFORM_ONLY = 0, 1, 2


@njit(nogil=True)
def _close(front: Frontend, platform: Platform, row: Any, t_ns: int, node: Node) -> None:
    """End a node, which is zero, of the row at t_ns: from the IMU if there is one, else from the platform."""
    if front.running == 1:
        newest = max(t_ns, front.t_imu, front.t_node)
        carried = front.carrying.carried
        close_node(front, newest, node)
        node.t_ns = newest
        if row.settings.heading_source == PLATFORM_ONLY:
            if front.carrying.carried != carried:
                refer_readings(platform, front)
            use_platform_heading(platform, front, node)
    else:
        newest = max(t_ns, platform.t_node)
        fill_platform_node(platform, newest, node)
        node.t_ns = newest
    apply_lever(row, node)


@njit(nogil=True)
def apply_lever(row: Any, node: Node) -> None:
    """Fill the node's swing, and turn its dv into that of the pivot."""
    x, y = row.settings.lever_x, row.settings.lever_y
    if x == 0.0 and y == 0.0:
        return
    c, s = math.cos(node.dyaw), math.sin(node.dyaw)
    node.swing_forward = (c - 1.0) * x - s * y
    node.swing_left = s * x + (c - 1.0) * y
    before = row.lever_rate
    if node.dt_s > 0.0:
        row.lever_rate = node.dyaw / node.dt_s
    after = row.lever_rate
    node.dv_forward -= -after * (c * y + s * x) + before * y
    node.dv_left -= after * (c * x - s * y) - before * x


@njit(nogil=True)
def _measure(node: Node, event: Event, row: Any, platform: Platform) -> None:
    """Put the event's measurement into the node."""
    node.kind = event.kind
    node.anchor = event.anchor
    node.z = event.value
    node.z_std = event.std
    node.lag_s = (node.t_ns - event.t_ns) * 1e-9
    if row.start.known == 1 and not np.isfinite(node.dv_var) and node.heading_kind != NO_HEADING:
        detect_first_motion(platform, node, event.value if node.kind == RANGE else np.nan, row.settings.range_std)


@njit(nogil=True)
def _last_end(front: Frontend, platform: Platform) -> int:
    if front.running == 1:
        return int(front.t_node)
    return int(platform.t_node) if platform.reading_count > 0 else -1


@njit(nogil=True)
def _is_long(front: Frontend, platform: Platform, t_ns: int) -> bool:
    """Return whether the row's node has lasted long enough to end without a measurement."""
    end = _last_end(front, platform)
    return end >= 0 and t_ns - end >= MAX_NODE_NS


@njit(cache=True, nogil=True)
def assemble_nodes(
    imu: Array,
    events: Array,
    order: Array,
    fronts: Array,
    platforms: Array,
    rows: Array,
    heights: Array,
    nodes: Nodes,
    verdicts: Array,
) -> int:
    """Fill `nodes`, zeros, from the samples in `order`: indices of IMU and, behind it, EVENT. Return how many.

    verdicts: what became of each IMU sample. The anchor of a pressure receives what became of it.
    """
    n = 0
    for k in range(len(order)):
        index = order[k]
        node = nodes[n]
        if index < len(imu):
            sample = imu[index]
            r, t_ns = sample.row, sample.t_ns
            row, front, platform = rows[r], fronts[r], platforms[r]
            verdicts[index] = add_sample(front, t_ns, sample.acc, sample.gyro, sample.mag)
            if not _is_long(front, platform, t_ns):
                continue
            _close(front, platform, row, t_ns, node)
        else:
            event = events[index - len(imu)]
            r, t_ns = event.row, event.t_ns
            row, front, platform = rows[r], fronts[r], platforms[r]
            if event.kind == PRESSURE_EVENT:
                event.anchor = add_pressure(heights[r], t_ns, event.value, event.std)
                continue
            if event.kind == HEADING_EVENT:
                if row.settings.heading_source != IMU_ONLY:
                    add_reading(platform, front, t_ns, event.value, event.std)
                if front.running == 1 or not _is_long(front, platform, t_ns):
                    continue
            _close(front, platform, row, t_ns, node)
            if event.kind != HEADING_EVENT:
                _measure(node, event, row, platform)
        height_at(heights[r], node.t_ns, node)
        node.row = r
        n += 1
    return n

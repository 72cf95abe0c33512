"""Samples of many rows, in order of row and time, to nodes: one compiled pass over the front-ends."""

from typing import Any, Final

import numpy as np

from .compiled import njit
from .frontend import close_node, feed
from .lever import swing
from .node import BEARING, NO_MEASUREMENT, RANGE
from .platform import derive_node, hear, refer_to_platform, watch_start

IMU_EVENT: Final = 0  # the order in which samples of the same instant are taken
HEADING_EVENT: Final = 1
RANGE_EVENT: Final = 2
BEARING_EVENT: Final = 3

EVENT: Final = np.dtype(
    [
        ("row", np.int32),
        ("t_ns", np.int64),
        ("kind", np.uint8),
        ("anchor", np.int32),
        ("value", np.float64, (9,)),  # acc, gyro, mag; or heading, std; range, std; bearing, std
    ]
)

LONGEST: Final = 100_000_000  # ns, of a node
AUTO, IMU_ONLY, PLATFORM_ONLY = 0, 1, 2


@njit(nogil=True)
def _close(front: Any, platform: Any, row: Any, t_ns: int, node: Any) -> None:
    """End a node of the row at t_ns: inertial if it has an IMU, else the platform's."""
    node.row = -1
    node.t_ns = t_ns
    node.kind = NO_MEASUREMENT
    node.lag_s = 0.0
    if front.running == 1:
        newest = max(t_ns, front.t_imu, front.t_node)
        close_node(front, newest, node)
        node.t_ns = newest
        if row.heading_source == PLATFORM_ONLY:
            refer_to_platform(platform, front, node)
    else:
        newest = max(t_ns, platform.t_node)
        derive_node(platform, newest, node)
        node.t_ns = newest
    swing(row, node)


@njit(nogil=True)
def _measure(node: Any, event: Any, row: Any, platform: Any) -> None:
    """Put the event's measurement into its node."""
    node.kind = RANGE if event.kind == RANGE_EVENT else BEARING
    node.anchor = event.anchor
    node.z = event.value[0]
    node.z_std = event.value[1]
    node.lag_s = (node.t_ns - event.t_ns) * 1e-9
    if row.start_known == 1 and not np.isfinite(node.dv_var):
        watch_start(platform, node, event.value[0] if node.kind == RANGE else np.nan, row.range_std)


@njit(nogil=True)
def _last_end(front: Any, platform: Any) -> int:
    if front.running == 1:
        return int(front.t_node)
    return int(platform.t_node) if platform.heard > 0 else -1


@njit(nogil=True)
def _take(event: Any, front: Any, platform: Any, row: Any) -> None:
    """An inertial sample or a heading into its front-end."""
    v = event.value
    if event.kind == IMU_EVENT:
        feed(front, event.t_ns, v[0:3], v[3:6], v[6:9])
    elif row.heading_source != IMU_ONLY:
        hear(platform, front, event.t_ns, v[0], v[1])


@njit(cache=True, nogil=True)
def gather(events: Any, order: Any, fronts: Any, platforms: Any, rows: Any, nodes: Any) -> int:
    """Fill nodes (at least as many as order) from the events in this order and return their number."""
    n = 0
    for k in range(len(order)):
        event = events[order[k]]
        row, front, platform = rows[event.row], fronts[event.row], platforms[event.row]
        node = nodes[n]
        if event.kind >= RANGE_EVENT:
            _close(front, platform, row, event.t_ns, node)
            _measure(node, event, row, platform)
            node.row = event.row
            n += 1
            continue
        _take(event, front, platform, row)
        end = _last_end(front, platform)
        if end >= 0 and event.t_ns - end >= LONGEST and (event.kind == IMU_EVENT or front.running == 0):
            _close(front, platform, row, event.t_ns, node)
            node.row = event.row
            n += 1
    return n

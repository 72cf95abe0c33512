"""Samples of many rows, in order of row and time, to nodes: one compiled pass over the front-ends."""

from typing import Any, Final

import numpy as np

from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.inertial import close_node, feed
from dropanchor_service.estimation.fleet.frontend.lever import swing
from dropanchor_service.estimation.fleet.frontend.node import BEARING, NO_MEASUREMENT, RANGE
from dropanchor_service.estimation.fleet.frontend.platform import derive_node, hear, refer_to_platform, watch_start

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
        ("value", np.float64),  # of the heading, range or bearing
        ("std", np.float64),
    ]
)

LONGEST: Final = 150_000_000  # ns, of a node: with ranges at 10 Hz, every node ends with one
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
    node.z = event.value
    node.z_std = event.std
    node.lag_s = (node.t_ns - event.t_ns) * 1e-9
    if row.start_known == 1 and not np.isfinite(node.dv_var):
        watch_start(platform, node, event.value if node.kind == RANGE else np.nan, row.range_std)


@njit(nogil=True)
def _last_end(front: Any, platform: Any) -> int:
    if front.running == 1:
        return int(front.t_node)
    return int(platform.t_node) if platform.heard > 0 else -1


@njit(nogil=True)
def _is_long(front: Any, platform: Any, t_ns: int) -> bool:
    """The row's node has lasted long enough."""
    end = _last_end(front, platform)
    return end >= 0 and t_ns - end >= LONGEST


@njit(cache=True, nogil=True)
def gather(imu: Any, events: Any, order: Any, fronts: Any, platforms: Any, rows: Any, nodes: Any) -> int:
    """Fill nodes (at least as many as order) from the samples in this order, IMU and EVENT; returns their number."""
    n = 0
    for k in range(len(order)):
        index = order[k]
        node = nodes[n]
        if index < len(imu):
            sample = imu[index]
            r, t_ns = sample.row, sample.t_ns
            row, front, platform = rows[r], fronts[r], platforms[r]
            feed(front, t_ns, sample.acc, sample.gyro, sample.mag)
            if not _is_long(front, platform, t_ns):
                continue
            _close(front, platform, row, t_ns, node)
        else:
            event = events[index - len(imu)]
            r, t_ns = event.row, event.t_ns
            row, front, platform = rows[r], fronts[r], platforms[r]
            if event.kind == HEADING_EVENT:
                if row.heading_source != IMU_ONLY:
                    hear(platform, front, t_ns, event.value, event.std)
                if front.running == 1 or not _is_long(front, platform, t_ns):
                    continue
            _close(front, platform, row, t_ns, node)
            if event.kind >= RANGE_EVENT:
                _measure(node, event, row, platform)
        node.row = r
        n += 1
    return n

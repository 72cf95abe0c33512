"""Drive the compiled IMU front-end over arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropanchor_service.estimation.fleet.frontend.inertial import add_sample, close_node
from dropanchor_service.estimation.fleet.frontend.node import NODE
from dropanchor_service.estimation.fleet.frontend.state import FRONTEND, start_frontend
from support.imu import Motion

Array = NDArray[Any]
START_NS = 1_700_000_000_000_000_000


def nanoseconds(t: Array) -> Array:
    """Convert s since START_NS to ns."""
    return START_NS + np.round(t * 1e9).astype(np.int64)


def drive(f: Any, t: Array, acc: Array, gyro: Array, mag: Array, ends: Array, nodes: Array) -> None:
    """Feed the samples up to each end and close a node there. Then feed the samples after the last end."""
    k = 0
    for e in range(len(ends)):
        while k < len(t) and t[k] <= ends[e]:
            add_sample(f, t[k], acc[k], gyro[k], mag[k])
            k += 1
        close_node(f, ends[e], nodes[e])
    while k < len(t):
        add_sample(f, t[k], acc[k], gyro[k], mag[k])
        k += 1


def new_frontend(hard_iron: float = 1.0, declination: float = 0.0) -> Array:
    """Return a front-end with one row."""
    rows = np.zeros(1, FRONTEND)
    start_frontend(rows[0], hard_iron, declination)
    return rows


def run(rows: Array, m: Motion, ends: Array) -> Array:
    """Feed a motion to the front-end and return its nodes at the times `ends` (n,) in s; (n,) NODE."""
    nodes = np.zeros(len(ends), NODE)
    acc, gyro, mag = map(np.ascontiguousarray, (m.acc, m.gyro, m.mag))
    drive(rows[0], nanoseconds(m.t), acc, gyro, mag, nanoseconds(ends), nodes)
    return nodes

"""A heading, range, bearing or pressure on its way to a node, and what does not get there."""

from typing import Any, Final, TypeAlias

import numpy as np

IMU_EVENT: Final = 0  # samples of the same instant are taken in this order
HEADING_EVENT: Final = 1
RANGE_EVENT: Final = 2
BEARING_EVENT: Final = 3
PRESSURE_EVENT: Final = 4

NONE: Final = -1  # index of no sample, and no anchor
UNTOUCHED: Final = -2  # of a row without samples in a batch

EVENT: Final = np.dtype(
    [
        ("row", np.int32),
        ("t_ns", np.int64),
        ("kind", np.uint8),
        ("anchor", np.int32),  # of a pressure: what became of it
        ("value", np.float64),  # of the heading or bearing, rad, of the range, m, or of the pressure, Pa
        ("std", np.float64),  # of a pressure: the temperature of the air, °C
    ]
)
Event: TypeAlias = Any  # a record of EVENT

ANCHOR_UNKNOWN, NOT_FINITE, LATE = range(3)
REASONS: Final = {"anchor_unknown": ANCHOR_UNKNOWN, "not_finite": NOT_FINITE, "late": LATE}
REJECTION: Final = np.dtype([("row", np.int32), ("reason", np.uint8), ("kind", np.uint8)])
KINDS: Final = {
    IMU_EVENT: "imu",
    HEADING_EVENT: "heading",
    RANGE_EVENT: "range",
    BEARING_EVENT: "bearing",
    PRESSURE_EVENT: "pressure",
}

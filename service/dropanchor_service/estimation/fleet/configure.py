"""From the settings of a tag to its row, with the defaults of what the operator left out."""

import math
from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.heading_models import REFERENCE_STD
from dropanchor_service.estimation.fleet.belief.layout import ROW, SETTINGS
from dropanchor_service.estimation.fleet.frontend.inertial import BIAS_LEFT
from dropanchor_service.estimation.fleet.measurement.rest import QUIET_START
from dropanchor_service.estimation.fleet.tuning import Tuning

RANGE_STD = 0.15  # m
HEIGHT_STD = 0.15  # m
START_STD = 0.1  # m
START_HEADING_STD = 0.05  # rad
START_SPEED_STD = 0.2  # m/s
SPEED_MAX = 10.0  # m/s
MOUNT_UNKNOWN_STD = 0.5  # rad
SLIP_KNOWN_STD, SLIP_UNKNOWN_STD = 0.05, 0.1  # rad, slip of what drives, sway of what is carried
SLIP_KNOWN_TAU, SLIP_UNKNOWN_TAU = 1.0, 3.0  # s


def configure_row(columns: Array, tuning: Tuning) -> Array:
    """Return ROW (0-d) of a tag without samples, from TAG_SETTINGS (0-d) and our defaults."""
    row = np.zeros((), ROW)
    settings, start = row["settings"], row["start"]
    for name in SETTINGS.names or ():
        if name in (columns.dtype.names or ()):
            settings[name] = columns[name]
    angle_given = math.isfinite(columns["mount_angle"])
    settings["mount_angle"] = columns["mount_angle"] if angle_given else 0.0
    mount_std = tuning.mount_known_std if angle_given else MOUNT_UNKNOWN_STD
    settings["mount_angle_std"] = _given(columns["mount_angle_std"], mount_std)
    settings["slip_given"] = math.isfinite(columns["slip_std"])
    settings["slip_std"] = _given(columns["slip_std"], SLIP_KNOWN_STD if angle_given else SLIP_UNKNOWN_STD)
    settings["slip_tau"] = SLIP_KNOWN_TAU if angle_given else SLIP_UNKNOWN_TAU
    settings["range_std_given"] = math.isfinite(columns["range_std"]) and columns["range_std"] > 0.0
    settings["range_std"] = _positive(columns["range_std"], RANGE_STD)
    settings["range_bias_std"] = _given(columns["range_bias_std"], tuning.range_bias_std)
    settings["height_std"] = HEIGHT_STD
    settings["reference_std"] = math.hypot(REFERENCE_STD, columns["declination_std"])
    settings["gyro_bias_std"] = BIAS_LEFT
    settings["speed_max"] = _positive(columns["speed_max"], SPEED_MAX)
    for name in ("known", "x", "y", "heading", "other_x", "other_y"):
        start[name] = columns[f"start_{name}"]
    start["std"] = _positive(columns["start_std"], START_STD)
    start["heading_std"] = START_HEADING_STD
    start["speed_std"] = START_SPEED_STD
    row["first_slot"] = -1
    row["anchor"] = -1
    row["quiet_share"] = QUIET_START
    return row


def _given(value: Any, default: float) -> float:
    """Return the value unless it is NaN. A standard deviation of 0 says that something is known exactly."""
    return float(value) if math.isfinite(value) else default


def _positive(value: Any, default: float) -> float:
    return float(value) if math.isfinite(value) and value > 0.0 else default

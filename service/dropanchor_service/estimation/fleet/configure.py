"""A tag's settings to its row, with the defaults of what is not told."""

import math
from typing import Any

import numpy as np

from dropanchor_service.estimation.fleet.belief.layout import ROW, SETTINGS
from dropanchor_service.estimation.fleet.tuning import Tuning

RANGE_STD = 0.1  # m
HEIGHT_STD = 0.15  # m
START_STD = 0.1  # m
START_HEADING_STD = 0.05  # rad
REFERENCE_STD = 0.1  # rad, constant error of a heading reference
V_MAX = 10.0  # m/s
MOUNT_KNOWN_STD, MOUNT_UNKNOWN_STD = 0.02, 0.5  # rad
CRAB_KNOWN_STD, CRAB_UNKNOWN_STD = 0.05, 0.1  # rad, slip of what drives, and sway of what is carried
CRAB_KNOWN_TAU, CRAB_UNKNOWN_TAU = 1.0, 3.0  # s
GYRO_STD = 0.001  # rad/s, what is left of the gyroscope's bias after the front-end, at least


def configured(settings: Any, tuning: Tuning) -> Any:
    """ROW (0-d) of a tag that has heard nothing; settings: TAG_SETTINGS (0-d)."""
    row = np.zeros((), ROW)
    for name, _ in SETTINGS:
        if name in settings.dtype.names:
            row[name] = settings[name]
    told = math.isfinite(settings["mount_angle"])
    row["mount"] = settings["mount_angle"] if told else 0.0
    mount_std = settings["mount_angle_std"]
    row["mount_std"] = mount_std if math.isfinite(mount_std) else (MOUNT_KNOWN_STD if told else MOUNT_UNKNOWN_STD)
    slip = settings["slip_std"]
    row["slip_known"] = math.isfinite(slip)
    row["crab_std"] = slip if row["slip_known"] else (CRAB_KNOWN_STD if told else CRAB_UNKNOWN_STD)
    row["crab_tau"] = CRAB_KNOWN_TAU if told else CRAB_UNKNOWN_TAU
    row["range_std"] = _or_default(settings["range_std"], RANGE_STD)
    row["offset"] = settings["range_bias"]
    bias_std = settings["range_bias_std"]
    row["offset_std"] = bias_std if math.isfinite(bias_std) else tuning.offset_std
    row["height_std"] = HEIGHT_STD
    row["start_std"] = _or_default(settings["start_std"], START_STD)
    row["start_heading_std"] = START_HEADING_STD
    row["start_speed_std"] = 0.3
    row["reference_std"] = REFERENCE_STD
    row["gyro_std"] = GYRO_STD
    row["v_max"] = _or_default(settings["speed_max"], V_MAX)
    row["reverse"] = settings["reverse_allowed"]
    row["head"] = -1
    row["anchor"] = -1
    return row


def _or_default(value: Any, default: float) -> float:
    return float(value) if math.isfinite(value) and value > 0.0 else default

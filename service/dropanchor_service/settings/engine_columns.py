"""Convert the settings of tags and anchors into the columns of an engine."""

import math
from collections.abc import Sequence

from dropanchor_schemas.site import Anchor, TagSettings
from dropanchor_service.estimation.columns import (
    Array,
    HeadingSource,
    HeightMotion,
    Motion,
    anchors_at,
    default_settings,
)

ACC_UNITS = {"m/s2": 1.0, "g": 9.80665, "mg": 0.00980665}
GYRO_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180.0}
RANGE_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048}


def anchor_columns(anchors: Sequence[Anchor]) -> Array:
    """Return one ANCHOR per anchor, in order."""
    columns = anchors_at(*((anchor.x, anchor.y, anchor.z) for anchor in anchors))
    columns["facing"] = [_or_nan(anchor.facing_rad) for anchor in anchors]
    columns["mirrors"] = [anchor.facing_rad is not None and anchor.mirrors_behind for anchor in anchors]
    return columns


def tag_columns(tag: TagSettings, declination_rad: float, declination_std_rad: float | None = None) -> Array:
    """Return TAG_SETTINGS (0-d). Settings that are not given are NaN. The declination and its error are the site's."""
    columns = default_settings()
    columns["height"] = tag.height_m
    columns["height_motion"] = HeightMotion[tag.height_motion.upper()]
    columns["range_std"] = _or_nan(tag.range_std_m)
    columns["range_bias"] = tag.range_bias_m
    columns["range_bias_std"] = _or_nan(tag.range_bias_std_m)
    columns["range_scale"] = tag.range_scale
    columns["mount_angle"] = _or_nan(tag.mount_angle_rad)
    columns["mount_angle_std"] = _or_nan(tag.mount_angle_std_rad)
    columns["lever_x"], columns["lever_y"] = tag.lever_forward_m, tag.lever_left_m
    columns["slip_std"] = _or_nan(tag.slip_std_rad)
    columns["speed_max"] = _or_nan(tag.speed_max_mps)
    columns["reverse_allowed"] = tag.reverse_allowed
    columns["heading_source"] = HeadingSource[tag.heading_source.upper()]
    columns["heading_std"] = _or_nan(tag.heading_std_rad)
    columns["magnetometer_calibrated"] = tag.magnetometer_calibrated
    columns["declination"], columns["declination_std"] = declination_rad, declination_std_rad or 0.0
    columns["motion"] = Motion[tag.motion.upper()]
    columns["acc_factor"] = ACC_UNITS[tag.acc_unit] * (-1.0 if tag.acc_reversed else 1.0)
    columns["gyro_factor"], columns["range_factor"] = GYRO_UNITS[tag.gyro_unit], RANGE_UNITS[tag.range_unit]
    columns["acc_sign_told"] = tag.acc_reversed is not None
    if tag.start is not None:
        columns["start_known"] = True
        columns["start_x"], columns["start_y"] = tag.start.x, tag.start.y
        columns["start_heading"] = _or_nan(tag.start.heading_rad)
        columns["start_std"] = tag.start.std_m
    return columns


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value

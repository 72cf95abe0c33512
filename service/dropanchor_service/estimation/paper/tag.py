"""The settings of one tag as plain numbers."""

import math
from dataclasses import dataclass

from dropanchor_service.estimation.columns import Array


@dataclass(frozen=True)
class Tag:
    """The fields of TAG_SETTINGS that the paper's engine uses."""

    height: float  # m
    range_std: float  # m, NaN: not given
    range_bias: float  # m
    range_scale: float
    mount_angle: float  # rad; 0 if it is not known
    reverse_allowed: bool  # the published filter does not use it; it only judges the state
    heading_source: int
    start_known: bool
    start_x: float  # m
    start_y: float  # m
    start_heading: float  # rad, of the body; NaN: not given
    start_std: float  # m, NaN: not given
    declination: float  # rad

    @classmethod
    def of(cls, settings: Array) -> "Tag":
        """Return the tag with these TAG_SETTINGS (0-d)."""
        values = {name: settings[name].item() for name in cls.__dataclass_fields__}
        if math.isfinite(settings["start_other_x"]):
            values["start_known"] = False  # the paper has no hypotheses of two places
        if not math.isfinite(values["mount_angle"]):
            values["mount_angle"] = 0.0
        return cls(**values)

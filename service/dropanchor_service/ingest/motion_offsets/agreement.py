"""Combine the lags of several windows. One window alone may be wrong; windows that agree are not."""

import math
from collections.abc import Sequence

import numpy as np

from dropanchor_service.ingest.motion_offsets.fit import Minimum
from dropanchor_service.store.clock_offsets import MotionOffset

MIN_WINDOWS = 4
MIN_SHARE = 0.5  # of the windows that tell
MAX_DEVIATION_S = 0.5
MIN_UNCERTAINTY_S = 0.25
FACTOR = 3.0  # of the uncertainty and a standard error, from simulated runs: the windows share errors
_LAG_STD_S = 0.1


def agreed(windows: Sequence[Minimum | None]) -> MotionOffset | None:
    """Return the offset that the windows agree on, None if they do not. They overlap by half; None does not tell."""
    told = [window for window in windows if window is not None]
    if len(told) < max(MIN_WINDOWS, MIN_SHARE * len(windows)):
        return None
    lags, half_widths = np.array(told).T
    weights = 1.0 / (half_widths**2 + _LAG_STD_S**2)
    mean = float(np.average(lags, weights=weights))
    if np.abs(lags - mean).max() > MAX_DEVIATION_S:
        return None
    std = math.sqrt(np.average((lags - mean) ** 2, weights=weights))
    independent = (len(told) + 1) / 2
    standard_error = max(std / math.sqrt(independent - 1.0), float(np.median(half_widths)) / math.sqrt(independent))
    return MotionOffset(mean, max(MIN_UNCERTAINTY_S, FACTOR * standard_error))

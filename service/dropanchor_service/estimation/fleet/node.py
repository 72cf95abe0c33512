"""What the front-end hands to the pose belief: one node per range, at most 0.1 s long.

A node is the pre-integrated IMU between two instants, together with what ended it.
Rows of different tags may be mixed; the nodes of one row are in order of time.
"""

from typing import Final

import numpy as np

NO_HEADING: Final = 0
ABSOLUTE_HEADING: Final = 1  # against a reference (magnetic north, a platform that knows the site frame)
RELATIVE_HEADING: Final = 2  # gyro only: zero is arbitrary or given at the start

NO_MEASUREMENT: Final = 0
RANGE: Final = 1
BEARING: Final = 2

NODE: Final = np.dtype(
    [
        ("row", np.int32),
        ("t_ns", np.int64),  # end of the interval
        ("dt_s", np.float64),
        ("dyaw", np.float64),  # rad, body yaw increment about the vertical, bias-corrected
        ("dyaw_var", np.float64),  # rad^2
        ("dv_forward", np.float64),  # m/s, gravity removed, in the body-yaw frame at the start of the interval
        ("dv_left", np.float64),  # m/s
        ("dv_var", np.float64),  # (m/s)^2, inf without an accelerometer
        ("heading", np.float64),  # rad, body yaw at the end of the interval
        ("heading_var", np.float64),  # rad^2
        ("heading_kind", np.uint8),
        ("rest", np.uint8),  # 1: standstill, confirmed
        ("kind", np.uint8),  # NO_MEASUREMENT, RANGE or BEARING
        ("anchor", np.int32),  # index into the anchor table
        ("z", np.float64),  # m (slant range) or rad (azimuth of the tag seen from the anchor)
        ("z_std", np.float64),  # m or rad; NaN: the tag's setting
    ]
)

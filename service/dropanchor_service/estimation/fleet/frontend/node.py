"""What the front-end hands to the pose belief: one node per range, about 0.15 s long at most.

A node is the pre-integrated IMU between two instants, together with what ended it.
Rows of different tags may be mixed; the nodes of one row are in order of time.
"""

from typing import Final

import numpy as np

NO_HEADING: Final = 0
ABSOLUTE_HEADING: Final = 1  # magnetic north; heading_var is of an error common to all nodes of a minute
RELATIVE_HEADING: Final = 2  # gyro only: zero is arbitrary or given at the start
MEASURED_HEADING: Final = 3  # the platform's readings beside an IMU; heading_var is what it claims
DERIVED_HEADING: Final = 4  # the platform's, without an IMU: dyaw is its own increment; it may be stable or drift

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
        ("gyro_var", np.float64),  # (rad/s)^2, of the bias that dyaw was corrected for; 0: not known
        ("gyro_step", np.float64),  # rad/s, by which that bias about the vertical changed in the interval
        ("dv_forward", np.float64),  # m/s, gravity removed, in the body-yaw frame at the start of the interval
        ("dv_left", np.float64),  # m/s
        ("swing_forward", np.float64),  # m, of the tag about the point that follows the course, in the same frame
        ("swing_left", np.float64),  # m
        ("dv_var", np.float64),  # (m/s)^2, inf without an accelerometer
        ("heading", np.float64),  # rad, body yaw at the end of the interval
        ("heading_var", np.float64),  # rad^2
        ("heading_kind", np.uint8),
        ("rest", np.uint8),  # 1: standstill, confirmed; 2: not moved since the start, so far as can be told
        ("kind", np.uint8),  # NO_MEASUREMENT, RANGE or BEARING
        ("anchor", np.int32),  # index into the anchor table
        ("z", np.float64),  # m (slant range) or rad (azimuth of the tag seen from the anchor)
        ("z_std", np.float64),  # m or rad; NaN: the tag's setting
        ("unheard_s", np.float64),  # of the interval, without IMU and without the platform's heading
        ("lag_s", np.float64),  # the measurement is that much older than the end of the interval (it came late)
    ]
)

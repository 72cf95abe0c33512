"""What the front-end gives the pose belief: one node per range, 0.15 s long at most.

A node is the pre-integrated IMU between two instants, with the measurement that ended it. Nodes of different rows may
be mixed; the nodes of one row are in order of time.
"""

from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from dropanchor_service.estimation.fleet.frontend.event import BEARING_EVENT, RANGE_EVENT

NO_HEADING: Final = 0
ABSOLUTE_HEADING: Final = 1  # from magnetic north; heading_var is of an error that lasts for minutes
RELATIVE_HEADING: Final = 2  # from the gyroscope: its zero is arbitrary, or given at the start
MEASURED_HEADING: Final = 3  # the platform's, beside an IMU; heading_var is what the platform claims
DERIVED_HEADING: Final = 4  # the platform's alone: dyaw is its own increment

MOVING: Final = 0  # what `rest` of a node says
RESTING: Final = 1  # confirmed by the IMU
NOT_MOVED: Final = 2  # has not moved since the start, so far as ranges and headings tell

NO_MEASUREMENT: Final = 0
RANGE: Final = RANGE_EVENT
BEARING: Final = BEARING_EVENT

NODE: Final = np.dtype(
    [
        ("row", np.int32),
        ("t_ns", np.int64),  # end of the interval
        ("dt_s", np.float64),
        ("dyaw", np.float64),  # rad, increment of body yaw about the vertical, without the gyroscope's bias
        ("dyaw_var", np.float64),  # rad^2
        ("gyro_bias_var", np.float64),  # (rad/s)^2, of the bias that was taken out of dyaw; 0: not known
        ("gyro_bias_step", np.float64),  # rad/s, change of that bias in the interval
        ("dv_forward", np.float64),  # m/s, without gravity, in the body-yaw frame at the start of the interval
        ("dv_left", np.float64),  # m/s
        ("swing_forward", np.float64),  # m, of the tag about the point that follows the course, in the same frame
        ("swing_left", np.float64),  # m
        ("gyro_tilt_var", np.float64),  # rad^2, of the tilt that the unknown bias of the gyroscope causes
        ("tilt_gain", np.float64),  # share of the acceleration that the tilt took for gravity in the interval
        ("dv_var", np.float64),  # (m/s)^2, inf without an accelerometer
        ("motion_var", np.float64),  # (m/s)^2, what of dv_var is motion of the vehicle: it shakes along one direction
        ("wander_var", np.float64),  # m^2, of each coordinate of a tag whose motion no sensor observes; 0: one does
        ("heading", np.float64),  # rad, body yaw at the end of the interval
        ("heading_var", np.float64),  # rad^2
        ("heading_kind", np.uint8),
        ("rest", np.uint8),  # MOVING, RESTING or NOT_MOVED
        ("kind", np.uint8),  # of the event that ended it, or NO_MEASUREMENT
        ("anchor", np.int32),  # index into the anchor table
        ("z", np.float64),  # m (slant range) or rad (azimuth of the tag seen from the anchor)
        ("z_std", np.float64),  # m or rad; NaN: the tag's setting
        ("unobserved_s", np.float64),  # s of the interval that neither the IMU nor the platform's heading observed
        ("lag_s", np.float64),  # s by which the measurement is older than the end of the interval
        ("carried", np.uint8),  # 1: a person carries the tag; what follows is then filled
        ("stepping", np.uint8),  # 1: steps seem to have begun, and may turn out to be those of a person
        ("upright", np.uint8),  # 1: body x is upright, so the azimuth of another axis is told as its heading
        ("stands", np.uint8),  # 1: no step for a while, and calm
        ("walked", np.float64),  # m since the person last stood; also of a tag that is not yet known to be carried
        ("step_speed", np.float64),  # m/s, from the steps; 0: none
        ("gait_angle", np.float64),  # rad, direction of the steps minus body yaw
        ("gait_coherence", np.float64),  # 0 to 1; 0: there is no such angle
        ("turned", np.float64),  # rad, of a quick turn that has just ended; 0: none
        ("height", np.float64),  # m, of the tag at the end of the interval, where it is not as told
        ("height_std", np.float64),  # m; 0: the height is as told
        ("height_source", np.uint8),  # TOLD, BY_PRESSURE or UNKNOWN of `height`
    ]
)

Node: TypeAlias = Any  # a record of NODE
Nodes: TypeAlias = npt.NDArray[np.void]  # NODE (n,)

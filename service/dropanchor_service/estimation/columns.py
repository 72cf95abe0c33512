"""What an engine takes and gives: columns of samples in, columns of poses out. A tag is a row number.

Units: SI and rad; times int64 ns on one clock; the site frame is ENU with x east; the body frame is x forward,
y left, z up. An unknown float is NaN.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

IMU = np.dtype([("row", "i4"), ("t_ns", "i8"), ("acc", "f8", 3), ("gyro", "f8", 3), ("mag", "f8", 3)])
RANGE = np.dtype([("row", "i4"), ("t_ns", "i8"), ("anchor", "i4"), ("range", "f8"), ("std", "f8")])
HEADING = np.dtype([("row", "i4"), ("t_ns", "i8"), ("heading", "f8"), ("std", "f8")])
BEARING = np.dtype([("row", "i4"), ("t_ns", "i8"), ("anchor", "i4"), ("bearing", "f8"), ("std", "f8")])
PRESSURE = np.dtype([("row", "i4"), ("t_ns", "i8"), ("pressure", "f8"), ("temperature", "f8")])  # Pa, °C

ANCHOR = np.dtype(
    [
        *((name, "f8") for name in ("x", "y", "z")),
        ("facing", "f8"),  # rad, NaN: it measures no azimuths, or nobody told it
        ("mirrors", "?"),  # whether it sees a tag behind it at the mirror image ahead
    ]
)

TAG_SETTINGS = np.dtype(
    [
        ("height", "f8"),
        ("range_std", "f8"),  # NaN: the engine's default
        ("range_bias", "f8"),
        ("range_bias_std", "f8"),  # NaN: the engine's default
        ("range_scale", "f8"),
        ("mount_angle", "f8"),  # NaN: not known
        ("mount_angle_std", "f8"),  # rad, NaN: the engine's default
        ("lever_x", "f8"),  # m, from the point that follows the course to the tag, body frame
        ("lever_y", "f8"),
        ("slip_std", "f8"),  # of the course about body axis and mounting angle, NaN: the engine's default
        ("speed_max", "f8"),  # m/s, NaN: the engine's default
        ("reverse_allowed", "?"),
        ("heading_source", "u1"),
        ("heading_std", "f8"),  # rad, of a platform's heading that does not drift, or of north; NaN: not known
        ("magnetometer_calibrated", "?"),
        ("start_known", "?"),
        ("start_x", "f8"),
        ("start_y", "f8"),
        ("start_heading", "f8"),  # NaN: not given
        ("start_std", "f8"),
        ("start_other_x", "f8"),  # another place where it may start as well, NaN: none
        ("start_other_y", "f8"),
        ("declination", "f8"),  # true minus magnetic north, positive east
        ("declination_std", "f8"),  # rad
        ("motion", "u1"),
        ("acc_factor", "f8"),  # by which the tag's accelerations become m/s²; engines get m/s², rad/s and m
        ("gyro_factor", "f8"),
        ("range_factor", "f8"),
        ("acc_sign_told", "?"),  # whether the operator says which way accelerations point
        ("height_motion", "u1"),
    ]
)

UNKNOWN = (
    "range_std",
    "range_bias_std",
    "mount_angle",
    "mount_angle_std",
    "slip_std",
    "speed_max",
    "heading_std",
    *(f"start_{name}" for name in ("x", "y", "heading", "std", "other_x", "other_y")),
)  # NaN by default

POSE = np.dtype(
    [
        ("row", "i4"),
        ("t_ns", "i8"),
        ("state", "u1"),
        ("reason", "u1"),
        ("frame", "u1"),  # Frame
        ("anchor", "i4"),  # of the last range that was fused, -1: none
        ("range", "f8"),  # that range, as measured
        ("x", "f8"),
        ("y", "f8"),
        ("z", "f8"),  # as told, or of the barometer
        ("z_std", "f8"),
        ("z_source", "u1"),  # HeightSource
        ("heading", "f8"),
        ("speed", "f8"),
        ("yaw_rate", "f8"),
        ("cov", "f8", (3, 3)),  # of (x, y, heading)
        ("p_mode", "f8"),
        ("sigma_pos", "f8"),
        ("sigma_obs", "f8"),
        ("parts", "f8", (6,)),  # of sigma_pos: north, mount, speed, bearing, ranges, height; all 0: not told
    ]
)

HYPOTHESIS = np.dtype(
    [
        ("row", "i4"),
        ("weight", "f8"),
        ("x", "f8"),
        ("y", "f8"),
        ("heading", "f8"),
        ("speed", "f8"),
        ("cov", "f8", (2, 2)),  # of (x, y)
    ]
)

INNOVATION = np.dtype(
    [
        ("row", "i4"),
        ("t_ns", "i8"),
        ("kind", "u1"),  # MeasurementKind
        ("anchor", "i4"),
        ("measured", "f8"),
        ("predicted", "f8"),
        ("innovation", "f8"),  # measured minus predicted
        ("S", "f8"),  # variance of the innovation
        ("p_outlier", "f8"),  # NaN: the engine has a hard gate instead
        ("fused", "?"),
        ("white_std", "f4"),  # m, how much ranges scatter anew each time; NaN: not known
        ("lasting_std", "f4"),  # m, of the errors of ranges that last for seconds
    ]
)


LAG = np.dtype([("row", "i4"), ("lag_ns", "i8")])  # how long measurements wait for IMU samples in batches; 0: not


class MeasurementKind(IntEnum):
    """What an innovation belongs to; it is in m or rad accordingly."""

    RANGE = 0
    BEARING = 1


class HeadingSource(IntEnum):
    """Where the heading comes from. AUTO: from the IMU if there is one, else from the platform."""

    AUTO = 0
    IMU = 1
    PLATFORM = 2


class Motion(IntEnum):
    """What moves the tag. AUTO: a person if it shows steps, else a vehicle."""

    AUTO = 0
    VEHICLE = 1
    CARRIED = 2


class HeightMotion(IntEnum):
    """What the height of a tag does. AUTO: it is as told until a pressure comes, and then follows that."""

    AUTO = 0
    FLAT = 1  # it is as told
    FREE = 2  # it is unknown and changes
    REFERENCE = 3  # it is as told, and the tag's barometer shows the weather


class HeightSource(IntEnum):
    """Where the height of a pose comes from."""

    TOLD = 0
    PRESSURE = 1
    UNKNOWN = 2
    START = 3  # it counts from the height of the start, which nobody told


class State(IntEnum):
    """Tracking state of a pose, in the order of the contract."""

    INITIALISING = 0
    AMBIGUOUS = 1
    TRACKING = 2
    COASTING = 3
    DEGRADED = 4
    LOST = 5


class Frame(IntEnum):
    """The frame of a pose, in the order of the contract."""

    SITE = 0
    RELATIVE = 1  # the site frame turned about the anchor by an angle that is not known


class StateReason(IntEnum):
    """The machine reason of a state."""

    NO_RANGE = 0  # no range has come yet
    NO_HEADING = 1  # neither attitude nor platform heading yet
    START_UNKNOWN = 2  # the engine cannot find the start by itself
    SEVERAL_MODES = 3  # more than one place explains the data
    RESOLVED = 4
    RANGES_MISSING = 5
    IMU_MISSING = 6
    RANGES_REJECTED = 7
    HEADING_DISTURBED = 8
    UNCERTAIN = 9  # the ellipse has grown too large
    FAULT = 10  # the row's numbers were not finite; it starts again
    HEADING_UNSURE = 11  # the heading may be wrong by a constant, and with it the direction from the anchor
    SENSOR_FAULT = 12  # a sensor failed its check; engines do not give it
    ANCHOR_DOUBTED = 13  # an anchor seems to have moved; engines do not give it
    FRONT_OR_BACK = 14  # the anchor cannot tell whether the tag is ahead of it or behind it


@dataclass(frozen=True)
class SampleBatch:
    """Samples of many tags, per row and kind in order of arrival. The engine puts the kinds in order of time.

    The fields stand in the order of the contract's `KINDS`. A column of a kind that measures one number ends in the
    value and a second number, mostly its std. An engine ignores the kinds that it does not use.
    """

    imu: Array = field(default_factory=lambda: np.empty(0, IMU))
    ranges: Array = field(default_factory=lambda: np.empty(0, RANGE))
    headings: Array = field(default_factory=lambda: np.empty(0, HEADING))
    bearings: Array = field(default_factory=lambda: np.empty(0, BEARING))
    pressures: Array = field(default_factory=lambda: np.empty(0, PRESSURE))

    def columns(self) -> tuple[Array, ...]:
        """Return the column of every kind, in the order of `KINDS`."""
        columns: tuple[Array, ...] = _columns_of(self)
        return columns

    def rows(self) -> Array:
        """Return the rows of all samples, each once, in ascending order."""
        return np.unique(np.concatenate([column["row"] for column in self.columns()]))

    def selected(self, selects: Callable[[Array], Array]) -> "SampleBatch":
        """Return the samples whose rows are selected."""
        return SampleBatch(*(column[selects(column["row"])] for column in self.columns()))


_columns_of = attrgetter(*SampleBatch.__dataclass_fields__)


@dataclass(frozen=True)
class PoseBatch:
    """poses: POSE, one for every range that was fused or rejected, per row in order of time.

    hypotheses: HYPOTHESIS, the modes behind the last pose of each row that is ambiguous.
    innovations: INNOVATION of the likeliest hypothesis, one for every range or bearing that met a running belief, per
    row in order of time.
    rejected: by reason (names of the contract), the row of each sample that was not used.
    unused: the same samples by kind.
    lags: LAG of rows with samples in the batch; none from an engine that does not wait.
    """

    poses: Array = field(default_factory=lambda: np.empty(0, POSE))
    hypotheses: Array = field(default_factory=lambda: np.empty(0, HYPOTHESIS))
    innovations: Array = field(default_factory=lambda: np.empty(0, INNOVATION))
    rejected: dict[str, Array] = field(default_factory=dict)
    unused: dict[str, Array] = field(default_factory=dict)
    lags: Array = field(default_factory=lambda: np.empty(0, LAG))


def anchors_at(*places: tuple[float, float, float]) -> Array:
    """Return ANCHOR of anchors at these places, which measure no azimuths."""
    return np.array([(*place, np.nan, False) for place in places], ANCHOR)


def default_settings() -> Array:
    """Return TAG_SETTINGS (0-d) of a tag about which nothing is known."""
    settings = np.zeros((), TAG_SETTINGS)
    for name in ("range_scale", "acc_factor", "gyro_factor", "range_factor"):
        settings[name] = 1.0
    for name in UNKNOWN:
        settings[name] = np.nan
    return settings

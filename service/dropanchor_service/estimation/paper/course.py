"""Direction of travel and turn rate of one tag, from its IMU or from the headings of its platform (line 10)."""

import math

from dropanchor_service.estimation.columns import HeadingSource
from dropanchor_service.estimation.paper.attitude import AttitudeFilter, Vector, wrapped
from dropanchor_service.estimation.paper.parameters import PaperParameters
from dropanchor_service.estimation.paper.tag import Tag

S_PER_NS = 1e-9


class Course:
    """The course of a tag: heading of the body + mounting angle, rad from east.

    The IMU is the source if its yaw counts from east (magnetometer, or a start heading). With AUTO the headings of the
    platform are used if it does not. The gyroscope gives the turn rate for every source.
    """

    def __init__(self, parameters: PaperParameters, tag: Tag) -> None:
        self._p = parameters
        self._mount = tag.mount_angle
        self._source = tag.heading_source
        self._attitude = AttitudeFilter(parameters.attitude, tag.declination, tag.start_heading)
        self._imu_ns: int | None = None
        self._platform: tuple[int, float] | None = None
        self._rates: list[float] = []  # about up, rad/s, since the last call of `straight`
        self._line = math.nan  # course at the beginning of the current straight line

    @property
    def from_imu(self) -> bool:
        """Return whether the IMU is the source now."""
        return self._source != HeadingSource.PLATFORM and self._attitude.absolute

    @property
    def newest(self) -> tuple[int, float] | None:
        """Return time, ns, and value, rad, of the newest course, None before the first."""
        if self.from_imu and self._imu_ns is not None:
            return self._imu_ns, wrapped(self._attitude.yaw + self._mount)
        return None if self._source == HeadingSource.IMU else self._platform

    @property
    def any_heading(self) -> bool:
        """Return whether there is a heading, even one relative to an unknown direction."""
        return self.newest is not None or (self._source != HeadingSource.PLATFORM and self._imu_ns is not None)

    def take_imu(self, t_ns: int, acc: Vector, gyro: Vector, mag: Vector) -> None:
        """Take an IMU sample. acc: m/s². gyro: rad/s. mag: any unit."""
        dt = 0.0 if self._imu_ns is None else (t_ns - self._imu_ns) * S_PER_NS
        self._imu_ns = t_ns
        self._attitude.step(dt, acc, gyro, mag)
        self._rates.append(self._attitude.up_rate(gyro))

    def take_platform(self, t_ns: int, heading: float) -> float:
        """Take a heading of the platform, rad. Return the course."""
        course = wrapped(heading + self._mount)
        self._platform = (t_ns, course)
        return course

    def straight(self, course: float) -> bool:
        """Return whether the tag has moved straight since the last call. course: its filtered direction now, rad.

        With a gyroscope this is the paper's |gyro| < TH_linear_motion, for the mean rate about up since the last range:
        a single sample is noisy, and tilting is not turning. Without one, the course must stay within TH of the course
        at the beginning of the line, as in the released code.
        """
        if self._rates:
            rate = sum(self._rates) / len(self._rates)
            self._rates.clear()
            return abs(rate) < self._p.th_turn_rate
        if abs(wrapped(course - self._line)) < self._p.th_turn:
            return True
        self._line = course
        return False

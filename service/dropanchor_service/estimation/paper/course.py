"""Direction of travel and turn rate of one tag, from its IMU or from headings its platform sends (line 10)."""

import math

from dropanchor_service.estimation.columns import HeadingSource
from dropanchor_service.estimation.paper.attitude import AttitudeFilter, Vector, wrapped
from dropanchor_service.estimation.paper.parameters import PaperParameters
from dropanchor_service.estimation.paper.tag import Tag

S_PER_NS = 1e-9


class Course:
    """Course = heading of the body + mounting angle, rad from east.

    The IMU is the source where its yaw counts from east (magnetometer, or a start heading); with AUTO the platform's
    headings fill in where it does not. The gyroscope gives the turn rate whatever the source.
    """

    def __init__(self, parameters: PaperParameters, tag: Tag) -> None:
        self._p = parameters
        self._mount = tag.mount_angle
        self._source = tag.heading_source
        self._attitude = AttitudeFilter(parameters.attitude, tag.declination, tag.start_heading)
        self._imu_ns: int | None = None
        self._platform: tuple[int, float] | None = None
        self._rates: list[float] = []  # about up, rad/s, since the turn rate was last asked for
        self._line = math.nan  # course at which the present straight line began

    @property
    def from_imu(self) -> bool:
        """Whether the IMU is the source now."""
        return self._source != HeadingSource.PLATFORM and self._attitude.absolute

    @property
    def newest(self) -> tuple[int, float] | None:
        """Time, ns, and value, rad, of the newest course; none before the first."""
        if self.from_imu and self._imu_ns is not None:
            return self._imu_ns, wrapped(self._attitude.yaw + self._mount)
        return None if self._source == HeadingSource.IMU else self._platform

    @property
    def any_heading(self) -> bool:
        """Whether there is a heading at all, be it one that counts from nowhere known."""
        return self.newest is not None or (self._source != HeadingSource.PLATFORM and self._imu_ns is not None)

    def take_imu(self, t_ns: int, acc: Vector, gyro: Vector, mag: Vector) -> None:
        """One IMU sample: m/s², rad/s, any unit of field."""
        dt = 0.0 if self._imu_ns is None else (t_ns - self._imu_ns) * S_PER_NS
        self._imu_ns = t_ns
        self._attitude.step(dt, acc, gyro, mag)
        self._rates.append(self._attitude.up_rate(gyro))

    def take_platform(self, t_ns: int, heading: float) -> float:
        """One heading of the platform, rad; the course it means."""
        course = wrapped(heading + self._mount)
        self._platform = (t_ns, course)
        return course

    def straight(self, course: float) -> bool:
        """Whether the tag has gone straight since this was last asked; course: its filtered direction now, rad.

        With a gyroscope, the paper's |gyro| < TH_linear_motion: here the mean rate about up since the last range, as
        a single sample is noise and tilting is not turning. Without, as in the released code, the course must stay
        within TH of where the line began.
        """
        if self._rates:
            rate = sum(self._rates) / len(self._rates)
            self._rates.clear()
            return abs(rate) < self._p.th_turn_rate
        if abs(wrapped(course - self._line)) < self._p.th_turn:
            return True
        self._line = course
        return False

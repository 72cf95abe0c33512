"""The methods of a client that publish one sample."""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from operator import index

from dropanchor_schemas.kinds import BearingSample, HeadingSample, ImuSample, PressureSample, RangeSample, Sample
from dropanchor_schemas.times import why_not_utc
from dropanchor_tag_client.buffer import number_of, vector
from dropanchor_tag_client.calibration import Calibration


class SampleMethods(ABC):
    """Make samples of measurements. Samples without a time are of now, on the clock of the client."""

    _boot_clock: bool
    _replay: bool
    _was_utc = False  # a time that it was asked about was UTC
    _calibration: Calibration | None

    @abstractmethod
    def _add(self, sample: Sample, anchor: int | str | None = None) -> None:
        """Publish a sample. anchor: as the caller named it."""

    def publish_range(
        self, anchor: int | str, range_m: float, *, t_ns: int | None = None, std_m: float = math.nan
    ) -> None:
        """Publish one two-way range to an anchor, m."""
        self._add(RangeSample(self._time(t_ns), number_of(anchor), float(range_m), float(std_m)), anchor)

    def publish_imu(
        self,
        acc: Sequence[float],
        gyro: Sequence[float],
        mag: Sequence[float] | None = None,
        *,
        t_ns: int | None = None,
    ) -> None:
        """Publish one IMU sample; body frame x forward, y left, z up.

        acc: specific force, m/s². gyro: angular rate, rad/s. mag: magnetic field, µT.
        """
        field = None if mag is None else vector("mag", mag)
        sample = ImuSample(self._time(t_ns), vector("acc", acc), vector("gyro", gyro), field)
        self._add(sample if self._calibration is None else self._calibration.applied(sample))

    def publish_heading(self, heading_rad: float, *, t_ns: int | None = None, std_rad: float = math.nan) -> None:
        """Publish a heading from the tag's platform, counter-clockwise from east, rad."""
        self._add(HeadingSample(self._time(t_ns), float(heading_rad), float(std_rad)))

    def publish_bearing(
        self, anchor: int | str, bearing_rad: float, *, t_ns: int | None = None, std_rad: float = math.nan
    ) -> None:
        """Publish the bearing of the tag, seen from the anchor, counter-clockwise from east, rad."""
        self._add(BearingSample(self._time(t_ns), number_of(anchor), float(bearing_rad), float(std_rad)), anchor)

    def publish_pressure(self, pressure_pa: float, *, t_ns: int | None = None, temperature_c: float = math.nan) -> None:
        """Publish the pressure of the air at the tag, Pa, as measured. temperature_c: of that air, °C."""
        self._add(PressureSample(self._time(t_ns), float(pressure_pa), float(temperature_c)))

    def why_not_utc(self, t_ns: int) -> str | None:
        """Return what is wrong with a time, None if nothing is.

        After a time that was UTC, an early one shows a clock that was reset, with which the service can deal.
        """
        if self._boot_clock or self._replay or self._was_utc:
            return None
        wrong = why_not_utc(t_ns)
        self._was_utc = wrong is None
        return wrong

    def _time(self, t_ns: int | None) -> int:
        if t_ns is not None:
            return index(t_ns)
        return time.monotonic_ns() if self._boot_clock else time.time_ns()

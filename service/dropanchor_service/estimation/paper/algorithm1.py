"""Algorithm 1 for one tag: samples in order of time, a pose for every range.

    line 10      heading = complementaryFilter(acc, gyro, magn)               attitude.py, course.py
    lines 11-12  EKF.predict(); EKF.update(range, heading)                    ekf.py
    lines 13-14  sRange = KF.predict(), KF.update(range)                      range_filter.py
    lines 15-18  straight and |sRange - last key range| > TH_distance: vel = VelEstimator(sRange, time)   speed.py
    line 19      v <- w v + (1 - w) vel

The paper has range and heading at the same moments. Here they come when they come: the EKF predicts to the time of
each range, fuses the newest attitude and then the range; while no range comes it fuses the attitude alone, every
`heading_interval`. Headings of a platform are fused one by one, as each is a measurement with noise of its own.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import State, StateReason
from dropanchor_service.estimation.paper.attitude import Vector, wrapped
from dropanchor_service.estimation.paper.course import S_PER_NS, Course
from dropanchor_service.estimation.paper.ekf import Innovation, PoseFilter, Position
from dropanchor_service.estimation.paper.parameters import PaperParameters
from dropanchor_service.estimation.paper.range_filter import RangeFilter
from dropanchor_service.estimation.paper.speed import SpeedEstimator
from dropanchor_service.estimation.paper.tag import Tag

NAN = math.nan
LARGEST_STD = 1e3  # m or rad; what claims more is not known

PoseValues = dict[str, Any]
"""Values of POSE by name, without its row. An absent value is NaN."""


@dataclass
class RangeTrack:
    """Smoothed range and speed from one anchor."""

    start_ns: int
    t_ns: int
    smooth: RangeFilter
    speed: SpeedEstimator


class Algorithm1:
    """The filters of one tag. Times are ns on the clock of the samples and must not decrease."""

    def __init__(self, parameters: PaperParameters, tag: Tag, faulted: bool = False) -> None:
        """faulted: the filters before these had to be dropped; the tag is no longer where it started."""
        self._p = parameters
        self._tag = tag
        self._faulted = faulted
        self._course = Course(parameters, tag)
        self._ekf: PoseFilter | None = None
        self._ekf_ns = 0
        self._attitude_ns: int | None = None  # of the newest attitude fused
        self._tracks: dict[int, RangeTrack] = {}
        self._speed = NAN  # newest estimate from ranges alone, m/s
        self._newest_range_ns: int | None = None  # of the newest range
        self._fused_ns = 0  # of the newest range fused
        self._fused = (-1, NAN)  # its anchor, and the range as measured
        self._lost = False
        self.innovation: Innovation | None = None  # of the last range, None if it met no belief

    def take_imu(self, t_ns: int, acc: Vector, gyro: Vector, mag: Vector) -> None:
        """Take an IMU sample: line 10, and lines 11-12 with the heading alone while ranges are missing."""
        self._course.take_imu(t_ns, acc, gyro, mag)
        if self._ekf is not None and (t_ns - self._ekf_ns) * S_PER_NS >= self._p.heading_interval:
            self._advance(self._ekf, t_ns)

    def take_heading(self, t_ns: int, heading: float, std: float) -> None:
        """Take a heading of the platform, rad, with its standard deviation or NaN."""
        course = self._course.take_platform(t_ns, heading)
        if self._ekf is not None and not self._course.from_imu and self._course.newest is not None:
            self._advance(self._ekf, t_ns)
            self._ekf.update_heading(course, _first_std(std, self._p.heading_std) ** 2)

    def take_range(self, t_ns: int, index: int, anchor: Position, measured: float, std: float) -> PoseValues:
        """Take a range, m, with its standard deviation or NaN. Return the pose after it.

        anchor: (x, y, height above the tag). measured = scale * distance + bias: z and R are those of the distance.
        """
        z = (measured - self._tag.range_bias) / self._tag.range_scale
        self.innovation = None
        R = (_first_std(std, self._tag.range_std, self._p.range_std) / self._tag.range_scale) ** 2
        if self._ekf is None:
            self._start(t_ns)
        if self._ekf is None:
            self._speed_from(t_ns, index, z)
        elif not self._lost and self._fuse(self._ekf, t_ns, anchor, z, R):
            self._correct_speed(self._ekf, t_ns, index, z)
            self._fused_ns, self._fused = t_ns, (index, measured)
        pose = self._pose(t_ns, z)
        self._newest_range_ns = t_ns
        return pose

    @property
    def finite(self) -> bool:
        """Return whether all numbers of the belief are finite."""
        return self._ekf is None or self._ekf.finite

    def _start(self, t_ns: int) -> None:
        course = self._course.newest
        if course is None or not self._tag.start_known:
            return
        p, tag = self._p, self._tag
        theta = course[1] if math.isnan(tag.start_heading) else tag.start_heading + tag.mount_angle
        sd = _first_std(tag.start_std, p.start_std)
        self._ekf = PoseFilter(
            x=np.array([tag.start_x, tag.start_y, theta, 0.0, 0.0]),
            P=np.diag([sd, sd, p.start_heading_std, p.start_speed_std, p.start_turn_rate_std]) ** 2,
            q=np.array([p.q_position, p.q_position, p.q_heading, p.q_speed, p.q_turn_rate]),
        )
        self._ekf_ns = self._fused_ns = t_ns

    def _advance(self, ekf: PoseFilter, t_ns: int) -> None:
        """Lines 11 and 12: predict to t_ns, and fuse the attitude if there is a new one."""
        ekf.advance((t_ns - self._ekf_ns) * S_PER_NS)
        self._ekf_ns = t_ns
        course = self._course.newest
        if course is not None and self._course.from_imu and course[0] != self._attitude_ns:
            self._attitude_ns = course[0]
            ekf.update_heading(course[1], self._p.heading_std**2)

    def _fuse(self, ekf: PoseFilter, t_ns: int, anchor: Position, z: float, R: float) -> bool:
        """Lines 11 and 12. A tag without a fused range for too long is lost: it cannot find itself again."""
        if (t_ns - self._fused_ns) * S_PER_NS > self._p.lost_after:
            self._lost = True
            return False
        self._advance(ekf, t_ns)
        self.innovation = ekf.update_range(z, R, anchor, self._p.gate)
        return self.innovation.fused

    def _correct_speed(self, ekf: PoseFilter, t_ns: int, index: int, z: float) -> None:
        """Lines 13 to 19. The covariance stays, as in the paper and in the released code."""
        v = self._speed_from(t_ns, index, z)
        if v is not None:
            ekf.x[3] = self._p.blend * ekf.x[3] + (1 - self._p.blend) * v

    def _speed_from(self, t_ns: int, index: int, z: float) -> float | None:
        """Lines 13 to 18: the speed, m/s, if this range gives one."""
        p = self._p
        track = self._tracks.get(index)
        if track is None:
            smooth = RangeFilter(z, p.q_smooth, p.r_smooth)
            speed = SpeedEstimator(p.th_distance, p.pair_spacing, p.window_base, p.window_ratio)
            track = self._tracks[index] = RangeTrack(t_ns, t_ns, smooth, speed)
        smoothed = track.smooth.step((t_ns - track.t_ns) * S_PER_NS, z)
        track.t_ns = t_ns
        if not self._straight():
            for other in self._tracks.values():
                other.speed.end_of_line()
            return None
        v = track.speed.step((t_ns - track.start_ns) * S_PER_NS, smoothed)
        self._speed = self._speed if v is None else v
        return v

    def _straight(self) -> bool:
        newest = self._course.newest
        if self._ekf is not None:
            return self._course.straight(float(self._ekf.x[2]))
        return self._course.straight(NAN if newest is None else newest[1])

    def _pose(self, t_ns: int, z: float) -> PoseValues:
        if self._ekf is None:
            return self.pose_before_start(t_ns)
        x, y, theta, v, w = self._ekf.x.tolist()
        cov = self._ekf.P[:3, :3].copy()
        sigma = math.sqrt(cov[0, 0] + cov[1, 1])
        state, reason = self._state(self._ekf, t_ns, sigma, z)
        heading = wrapped(theta - self._tag.mount_angle)
        motion = {"x": x, "y": y, "heading": heading, "speed": v, "yaw_rate": w, "cov": cov, "sigma_pos": sigma}
        return self._values(t_ns, state, reason) | motion

    def pose_before_start(self, t_ns: int) -> PoseValues:
        """Return the pose of a tag that may be anywhere."""
        state, reason = self._state_before_start()
        course = self._course.newest
        heading = NAN if course is None else wrapped(course[1] - self._tag.mount_angle)
        return self._values(t_ns, state, reason) | {"heading": heading, "speed": self._speed}

    def _values(self, t_ns: int, state: State, reason: StateReason) -> PoseValues:
        anchor, measured = self._fused
        return {"t_ns": t_ns, "state": state, "reason": reason, "anchor": anchor, "range": measured}

    def _state_before_start(self) -> tuple[State, StateReason]:
        if self._faulted:
            self._faulted = False
            return State.INITIALISING, StateReason.FAULT
        if not self._course.any_heading:
            return State.INITIALISING, StateReason.NO_HEADING
        return State.AMBIGUOUS, StateReason.START_UNKNOWN

    def _state(self, ekf: PoseFilter, t_ns: int, sigma: float, z: float) -> tuple[State, StateReason]:
        """LOST, COASTING: no range fused for long. DEGRADED: no heading for long; or a tag that cannot drive
        backwards is believed to, the mark of the mirror image (p, v) -> (-p, -v); or sigma_pos too large for use.
        """
        p = self._p
        silent = self._newest_range_ns is not None and (t_ns - self._newest_range_ns) * S_PER_NS > p.coasting_after
        why = StateReason.RANGES_MISSING if silent else StateReason.RANGES_REJECTED
        if self._lost:
            return State.LOST, why
        if (t_ns - self._fused_ns) * S_PER_NS > p.coasting_after:
            return State.COASTING, why
        course = self._course.newest
        if course is None or (t_ns - course[0]) * S_PER_NS > p.heading_stale_after:
            return State.DEGRADED, StateReason.IMU_MISSING
        if not self._tag.reverse_allowed and ekf.x[3] < -p.backwards * math.sqrt(ekf.P[3, 3]):
            return State.DEGRADED, StateReason.SEVERAL_MODES
        if not sigma <= max(p.degraded_sigma, p.degraded_share * z):
            return State.DEGRADED, StateReason.UNCERTAIN
        return State.TRACKING, StateReason.RESOLVED


def _first_std(*candidates: float) -> float:
    """Return the first that can be a standard deviation: the sample's own, the tag's, or the default."""
    return next(s for s in candidates if 0 < s < LARGEST_STD)

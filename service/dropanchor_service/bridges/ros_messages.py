"""Read and write the ROS 2 messages that matter here, as CDR. The types are those of ROS 2 Jazzy.

Messages of ROS 2 Humble are read too: its Imu has the same fields, its Range has no variance.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from dropanchor_schemas.wire import HeadingSample, ImuSample, PressureSample, RangeSample, anchor_number
from dropanchor_service.bridges.frames import SITE
from dropanchor_service.bridges.rmw_zenoh import NO_TYPE_HASH, RosType
from dropanchor_service.bridges.ros2dds import ANY_TYPE_HASH

Json = Mapping[str, Any]

UNKNOWN_VARIANCE = 1e6  # of roll and pitch, which are not estimated, of a z that was not measured, and of the twist
USABLE_STATES = ("tracking", "coasting", "degraded")
TWIST_COVARIANCE = np.diag([UNKNOWN_VARIANCE] * 6).reshape(-1)
_UNIT = 0.05  # how far the square of a rotation's quaternion may be from 1
_X, _Y, _Z, _YAW = 0, 1, 2, 5  # rows of the 6 × 6 covariances of ROS


class UnusableError(ValueError):
    """The message holds no sample. The text names why."""


class RosMessages:
    """The message types, and the conversions."""

    def __init__(self) -> None:
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._humble = get_typestore(Stores.ROS2_HUMBLE)
        self.imu = self._type("sensor_msgs/msg/Imu")
        self.range = self._type("sensor_msgs/msg/Range")
        self.pressure = self._type("sensor_msgs/msg/FluidPressure")
        self.pose = self._type("geometry_msgs/msg/PoseWithCovarianceStamped")
        self.odometry = self._type("nav_msgs/msg/Odometry")
        self.tf = self._type("tf2_msgs/msg/TFMessage")

    def imu_sample(self, cdr: bytes, t_ns: int, type_hash: str) -> ImuSample:
        """Return the sample of a sensor_msgs/Imu. t_ns: its time if it has no stamp. Raises UnusableError."""
        message = self._read(cdr, self.imu, type_hash)
        for name in ("angular_velocity", "linear_acceleration"):
            if getattr(message, f"{name}_covariance")[0] == -1.0:  # by definition of the message
                raise UnusableError(f"an IMU message without {name}, as {name}_covariance[0] = -1 says")
        acc, gyro = message.linear_acceleration, message.angular_velocity
        if not all(map(math.isfinite, (acc.x, acc.y, acc.z, gyro.x, gyro.y, gyro.z))):
            raise UnusableError("an IMU message that is not finite")
        if not (acc.x or acc.y or acc.z):
            raise UnusableError("an IMU message whose linear_acceleration is 0 along all axes: it was not measured")
        return ImuSample(_time_ns(message, t_ns), (acc.x, acc.y, acc.z), (gyro.x, gyro.y, gyro.z), None)

    def range_sample(self, cdr: bytes, t_ns: int, anchor: str, type_hash: str) -> RangeSample:
        """Return the sample of a sensor_msgs/Range. t_ns: its time if it has no stamp. Raises UnusableError."""
        message = self._read(cdr, self.range, type_hash)
        if not math.isfinite(message.range):  # infinite means: too close, or nothing there
            raise UnusableError("a range that is not finite")
        has_limits = message.max_range > message.min_range
        if has_limits and not message.min_range <= message.range <= message.max_range:
            raise UnusableError("a range outside min_range and max_range")
        variance = getattr(message, "variance", 0.0)  # Humble has none
        std_m = math.sqrt(variance) if variance > 0 else math.nan
        return RangeSample(_time_ns(message, t_ns), anchor_number(anchor), message.range, std_m)

    def pressure_sample(self, cdr: bytes, t_ns: int, type_hash: str) -> PressureSample:
        """Return the sample of a sensor_msgs/FluidPressure. t_ns: its time if it has no stamp. Raises UnusableError."""
        message = self._read(cdr, self.pressure, type_hash)
        if not math.isfinite(message.fluid_pressure):
            raise UnusableError("a pressure that is not finite")
        return PressureSample(_time_ns(message, t_ns), message.fluid_pressure)

    def heading_sample(self, cdr: bytes, t_ns: int, x_rad: float, type_hash: str) -> HeadingSample:
        """Return the heading of a nav_msgs/Odometry. x_rad: heading of the x axis of its frame. Raises UnusableError.

        t_ns: its time if it has no stamp.
        """
        message = self._read(cdr, self.odometry, type_hash)
        turn = message.pose.pose.orientation
        if not abs(turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2 - 1) < _UNIT:  # infinite, NaN and 0 included
            raise UnusableError("an odometry message whose orientation is no rotation")
        yaw_rad = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
        variance = message.pose.covariance[_YAW * 7]
        std_rad = math.sqrt(variance) if 0 < variance < math.pi**2 else math.nan
        return HeadingSample(_time_ns(message, t_ns), math.remainder(yaw_rad + x_rad, math.tau), std_rad)

    def pose_cdr(self, pose: Json, height_m: float) -> bytes:
        """Return the geometry_msgs/PoseWithCovarianceStamped of a usable pose (JSON of `Pose`)."""
        return self._write(self.pose, header=self._header(pose), pose=self._pose_with_covariance(pose, height_m))

    def odometry_cdr(self, pose: Json, height_m: float, child_frame: str) -> bytes:
        """Return the nav_msgs/Odometry of a usable pose with a speed. How sure its twist is, is not known."""
        twist = self._make(
            "geometry_msgs/msg/Twist",
            linear=self._make("geometry_msgs/msg/Vector3", x=pose["speed_mps"], y=0.0, z=0.0),
            angular=self._make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=pose["yaw_rate_radps"]),
        )
        return self._write(
            self.odometry,
            header=self._header(pose),
            child_frame_id=child_frame,
            pose=self._pose_with_covariance(pose, height_m),
            twist=self._make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=TWIST_COVARIANCE),
        )

    def tf_cdr(self, pose: Json, height_m: float, child_frame: str) -> bytes:
        """Return the tf2_msgs/TFMessage of a usable pose."""
        place = self._make("geometry_msgs/msg/Vector3", x=pose["x"], y=pose["y"], z=height_m)
        transform = self._make("geometry_msgs/msg/Transform", translation=place, rotation=self._rotation(pose))
        stamped = self._make(
            "geometry_msgs/msg/TransformStamped",
            header=self._header(pose),
            child_frame_id=child_frame,
            transform=transform,
        )
        return self._write(self.tf, transforms=[stamped])

    def _pose_with_covariance(self, pose: Json, height_m: float) -> Any:
        point = self._make("geometry_msgs/msg/Point", x=pose["x"], y=pose["y"], z=height_m)
        placed = self._make("geometry_msgs/msg/Pose", position=point, orientation=self._rotation(pose))
        covariance = np.diag([0.0, 0.0, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE, 0.0])
        covariance[np.ix_([_X, _Y, _YAW], [_X, _Y, _YAW])] = pose["covariance"]
        if pose.get("z_source") == "pressure":
            covariance[_Z, _Z] = pose["z_std_m"] ** 2
        return self._make("geometry_msgs/msg/PoseWithCovariance", pose=placed, covariance=covariance.reshape(-1))

    def _rotation(self, pose: Json) -> Any:
        half_rad = pose["heading_rad"] / 2
        return self._make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half_rad), w=math.cos(half_rad))

    def _header(self, pose: Json) -> Any:
        sec, nanosec = divmod(pose["t_ns"], 1_000_000_000)
        stamp = self._make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        return self._make("std_msgs/msg/Header", stamp=stamp, frame_id=SITE)

    def _type(self, name: str) -> RosType:
        return RosType(name, self._store.hash_rihs01(name))

    def _make(self, name: str, **fields: Any) -> Any:
        return self._store.types[name](**fields)

    def _write(self, of: RosType, **fields: Any) -> bytes:
        return bytes(self._store.serialize_cdr(self._make(of.name, **fields), of.name))

    def _read(self, cdr: bytes, of: RosType, type_hash: str) -> Any:
        stores = {of.type_hash: [self._store], NO_TYPE_HASH: [self._humble], ANY_TYPE_HASH: [self._store, self._humble]}
        if type_hash not in stores:
            raise UnusableError(f"a {of.name} with other fields than in ROS 2 Humble and Jazzy")
        for store in stores[type_hash]:
            with suppress(SerdeError):
                return store.deserialize_cdr(cdr, of.name)
        raise UnusableError(f"a damaged {of.name}")


def is_usable(pose: Json) -> bool:
    """Return whether a robot may act on the pose. ROS messages cannot say that it is lost, ambiguous or relative."""
    needed = ("x", "y", "heading_rad", "covariance")
    in_site = pose["frame"] == SITE  # services before the state `relative` say it only here
    return in_site and pose["state"] in USABLE_STATES and all(pose[name] is not None for name in needed)


def _time_ns(message: Any, t_ns: int) -> int:
    stamp = message.header.stamp
    return stamp.sec * 1_000_000_000 + stamp.nanosec or t_ns

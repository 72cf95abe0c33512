"""CDR, rmw_zenoh and zenoh-bridge-ros2dds as a robot speaks them, apart from the code under test.

They are written from their specifications and sources.
"""

import math
import struct
import time
from dataclasses import dataclass, field
from typing import Any

import zenoh

from support.patience import PATIENCE_S

HEADER = b"\x00\x01\x00\x00"  # plain CDR, little-endian
IMU = "sensor_msgs::msg::dds_::Imu_/RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"
RANGE = "sensor_msgs::msg::dds_::Range_/RIHS01_b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a"
PRESSURE = (
    "sensor_msgs::msg::dds_::FluidPressure_/RIHS01_22dfb2b145a0bd5a31a1ac3882a1b32148b51d9b2f3bab250290d66f3595bc32"
)
POSE = (
    "geometry_msgs::msg::dds_::PoseWithCovarianceStamped_/"
    "RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e"
)
ODOMETRY = "nav_msgs::msg::dds_::Odometry_/RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
TF = "tf2_msgs::msg::dds_::TFMessage_/RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"


class CdrWriter:
    """Appends values, each aligned to its size from the end of the header."""

    def __init__(self) -> None:
        self._body = b""

    def add(self, form: str, *values: float) -> "CdrWriter":
        """Append numbers of one struct format, such as `d`."""
        for value in values:
            self._body += bytes(-len(self._body) % struct.calcsize(form)) + struct.pack(f"<{form}", value)
        return self

    def text(self, text: str) -> "CdrWriter":
        data = text.encode() + b"\0"
        self.add("I", len(data))
        self._body += data
        return self

    def header(self, t_ns: int, frame: str) -> "CdrWriter":
        return self.add("i", t_ns // 10**9).add("I", t_ns % 10**9).text(frame)

    @property
    def cdr(self) -> bytes:
        return HEADER + self._body


class CdrReader:
    """Takes values one after the other. `end` checks that nothing is left."""

    def __init__(self, cdr: bytes) -> None:
        assert cdr[:4] == HEADER
        self._body = cdr[4:]
        self._at = 0

    def take(self, form: str, count: int = 1) -> list[Any]:
        size = struct.calcsize(form)
        self._at += -self._at % size
        values = struct.unpack_from(f"<{count}{form}", self._body, self._at)
        self._at += count * size
        return list(values)

    def text(self) -> str:
        (length,) = self.take("I")
        data = self._body[self._at : self._at + length]
        self._at += length
        assert data.endswith(b"\0")
        return data[:-1].decode()

    def stamp_and_frame(self) -> tuple[int, str]:
        (sec,), (nanosec,) = self.take("i"), self.take("I")
        return sec * 10**9 + nanosec, self.text()

    def end(self) -> None:
        assert self._at == len(self._body)


def imu_cdr(t_ns: int, acc: tuple[float, ...], gyro: tuple[float, ...], covariance: float = 0.0) -> bytes:
    """Return a sensor_msgs/Imu. covariance: first of those of gyroscope and accelerometer."""
    writer = CdrWriter().header(t_ns, "imu_link").add("d", 0, 0, 0, 1).add("d", -1, *[0] * 8)
    for vector in (gyro, acc):
        writer.add("d", *vector).add("d", covariance, *[0] * 8)
    return writer.cdr


def range_cdr(t_ns: int, range_m: float, variance: float = 0.01, max_range: float = 100.0) -> bytes:
    """Return a sensor_msgs/Range."""
    return CdrWriter().header(t_ns, "uwb").add("B", 0).add("f", 0.1, 0.0, max_range, range_m, variance).cdr


def pressure_cdr(t_ns: int, pressure_pa: float) -> bytes:
    """Return a sensor_msgs/FluidPressure."""
    return CdrWriter().header(t_ns, "barometer").add("d", pressure_pa, 0.0).cdr


def odometry_cdr(t_ns: int, quaternion: tuple[float, ...], yaw_variance: float = 0.0) -> bytes:
    """Return a nav_msgs/Odometry. quaternion: x, y, z, w."""
    writer = CdrWriter().header(t_ns, "odom").text("base_link").add("d", 0, 0, 0, *quaternion)
    return writer.add("d", *[0] * 35, yaw_variance).add("d", *[0] * 42).cdr


def read_pose(reader: CdrReader) -> tuple[list[float], float, list[float]]:
    """Return position, heading and covariance (36) of a geometry_msgs/PoseWithCovariance."""
    x, y, z, qx, qy, qz, qw = reader.take("d", 7)
    assert qx == qy == 0.0
    return [x, y, z], 2 * math.atan2(qz, qw), reader.take("d", 36)


@dataclass
class Robot:
    """A robot with a session of its own at the router of its nodes. received: of each key, payload and attachment.

    dds: its nodes use DDS, and the session is that of zenoh-bridge-ros2dds.
    """

    session: zenoh.Session
    domain: int = 0
    received: dict[str, list[tuple[bytes, bytes]]] = field(default_factory=dict)
    sequence: int = 0
    dds: bool = False

    def key(self, topic: str, of: str) -> str:
        return topic if self.dds else f"{self.domain}/{topic}/{of}"

    def publish(self, topic: str, of: str, cdr: bytes, t_ns: int | None = None) -> None:
        if self.dds:  # which tells nothing but the message
            self.session.put(self.key(topic, of), cdr)
            return
        self.sequence += 1
        sent_ns = time.time_ns() if t_ns is None else t_ns
        attachment = struct.pack("<qqB16s", self.sequence, sent_ns, 16, b"robot")
        self.session.put(self.key(topic, of), cdr, attachment=attachment)

    def subscribe(self, topic: str, of: str) -> str:
        key = self.key(topic, of)
        messages = self.received.setdefault(key, [])

        def receive(sample: zenoh.Sample) -> None:
            assert sample.attachment is not None
            messages.append((sample.payload.to_bytes(), sample.attachment.to_bytes()))

        self.session.declare_subscriber(key, receive)
        return key

    def tokens(self) -> set[str]:
        """Return the liveliness keys of all ROS entities of the domain."""
        where = "@/*/@ros2_lv/**" if self.dds else f"@ros2_lv/{self.domain}/**"
        replies = self.session.liveliness().get(where, timeout=PATIENCE_S)
        return {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}

"""Write a recording in the formats that people have: tables, exports of phones, bags."""

import csv
import io
import json
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from dropanchor_tag_client.recording import Recording, read_recording
from dropanchor_tag_client.simulator.recording import write_recording
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import simulate

T0_NS = 1_760_000_000_000_000_000
PRESSURE_HPA = 987.25
G_MPS2 = 9.80665
VECTORS = (("ax", "ay", "az"), ("gx", "gy", "gz"), ("mx", "my", "mz"))


def drive(folder: Path) -> Recording:
    """Simulate a drive of a minute into the folder, and return its recording. The ranges have no std, as in ROS 1."""
    write_recording(simulate("S5", 3, preset("real", imu_hz=100.0)), folder)
    ranges = [line.rsplit(",", 1)[0] for line in (folder / "range.csv").read_text().splitlines()]
    (folder / "range.csv").write_text("\n".join(ranges) + "\n")
    return read_recording(folder)


def imu_of(recording: Recording) -> tuple[list[int], "np.ndarray[Any, Any]"]:
    """Return UTC in ns, and acc, gyro and mag as (n, 9)."""
    columns = [recording.imu[name] for vector in VECTORS for name in vector]
    return utc_ns(recording.imu["t_s"]), np.column_stack([np.asarray(column) for column in columns])


def utc_ns(t_s: Iterable[float]) -> list[int]:
    return [T0_NS + round(t * 1e9) for t in t_s]


def ranges_of(recording: Recording) -> list[tuple[int, str, float]]:
    """Return UTC in ns, anchor and range in m."""
    times, columns = utc_ns(recording.ranges["t_s"]), recording.ranges
    return list(zip(times, recording.range_anchors, columns["range_m"], strict=True))


def text(header: Sequence[str], rows: Iterable[Sequence[Any]], separator: str = ",", comma: bool = False) -> str:
    """Return a table. comma: numbers have decimal commas."""
    out = io.StringIO()
    writer = csv.writer(out, delimiter=separator, lineterminator="\r\n")
    writer.writerow(header)
    for row in rows:
        cells = [repr(cell) if isinstance(cell, float) else str(cell) for cell in row]
        writer.writerow([cell.replace(".", ",") for cell in cells] if comma else cells)
    return out.getvalue()


def write_range_csv(path: Path, recording: Recording) -> Path:
    path.write_text(text(("timestamp_ns", "anchor_id", "distance_m"), ranges_of(recording)))
    return path


def zipped(path: Path, files: dict[str, str]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def phone_axes(body: "np.ndarray[Any, Any]") -> list[tuple[float, float, float]]:
    """Return vectors of the tag in the axes of a phone whose top edge points forward: x right, y forward."""
    return [(-y, x, z) for x, y, z in body.tolist()]


def sensor_logger(path: Path, recording: Recording, ios: bool = False, platform: str | None = None) -> Path:
    """Write an export of Sensor Logger. ios: with the sign of an iPhone, and gravity apart."""
    t_ns, imu = imu_of(recording)
    acc = np.array(phone_axes(imu[:, :3])) * (-1.0 if ios else 1.0)
    gravity = np.tile([0.0, 0.0, -G_MPS2 if ios else G_MPS2], (len(acc), 1))
    sensors = {"Gyroscope": phone_axes(imu[:, 3:6]), "Magnetometer": phone_axes(imu[:, 6:])}
    sensors |= (
        {"Accelerometer": (acc - gravity).tolist(), "Gravity": gravity.tolist()}
        if ios
        else {"TotalAcceleration": acc.tolist()}
    )
    files = {
        f"{name}.csv": text(
            ("time", "seconds_elapsed", "z", "y", "x"),
            [(t, (t - T0_NS) / 1e9, z, y, x) for t, (x, y, z) in zip(t_ns, vectors, strict=True)],
        )
        for name, vectors in sensors.items()
    }
    files["Barometer.csv"] = text(
        ("time", "seconds_elapsed", "relativeAltitude", "pressure"),
        [(t, (t - T0_NS) / 1e9, 0.0, PRESSURE_HPA) for t in t_ns[::10]],
    )
    files["Location.csv"] = "time,seconds_elapsed,latitude,longitude\n1,0.1,52.5,13.4\n"
    if platform:
        files["Metadata.csv"] = f"version,device name,platform,standardisation\n3,Phone,{platform},false\n"
    return zipped(path, files)


def phyphox(folder: Path, recording: Recording, separator: str = ",", comma: bool = False) -> Path:
    """Write an export of phyphox, with its times."""
    _, imu = imu_of(recording)
    names = {
        "Accelerometer": ("Acceleration", "m/s^2", imu[:, :3]),
        "Gyroscope": ("Gyroscope", "rad/s", imu[:, 3:6]),
        "Magnetometer": ("Magnetic field", "µT", imu[:, 6:]),
    }
    (folder / "meta").mkdir(parents=True)
    for name, (quantity, unit, vectors) in names.items():
        header = ["Time (s)", *(f"{quantity} {axis} ({unit})" for axis in "xyz"), f"Absolute {quantity} ({unit})"]
        lines = [separator.join(f'"{column}"' for column in header)]
        for t_s, vector in zip(recording.imu["t_s"], phone_axes(vectors), strict=True):
            cells = [f"{value:.15E}" for value in (t_s, *vector, 0.0)]
            lines.append(separator.join(cell.replace(".", ",") if comma else cell for cell in cells))
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    lines = [separator.join(('"Time (s)"', '"Pressure (hPa)"'))]
    for t_s in recording.imu["t_s"][::10]:
        cells = [f"{value:.15E}" for value in (t_s, PRESSURE_HPA)]
        lines.append(separator.join(cell.replace(".", ",") if comma else cell for cell in cells))
    (folder / "Pressure.csv").write_text("\n".join(lines) + "\n")
    times = f'"START",0.000000000E0,{T0_NS / 1e9:.3f},"then"\n"PAUSE",1E3,{T0_NS / 1e9 + 1e3:.3f},"later"\n'
    (folder / "meta" / "time.csv").write_text(f'"event","experiment time","system time","system time text"\n{times}')
    (folder / "meta" / "device.csv").write_text('"property","value"\n"deviceModel","x"\n')
    return folder


UWB = """std_msgs/Header header
uint16 responder_id
int32 distance_mm
float32 rssi
"""


class Messages:
    """Makes messages of one release of ROS."""

    def __init__(self, store: Stores) -> None:
        self.store: Typestore = get_typestore(store)
        self.is_ros1 = store is Stores.ROS1_NOETIC
        self.store.register(get_types_from_msg(UWB, "uwb_msgs/msg/UwbRange"))

    def make(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def header(self, t_ns: int) -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", sec=t_ns // 10**9, nanosec=t_ns % 10**9)
        sequence = {"seq": 0} if self.is_ros1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id="base", **sequence)

    def vector(self, values: Sequence[float]) -> Any:
        return self.make("geometry_msgs/msg/Vector3", x=values[0], y=values[1], z=values[2])

    def imu(self, t_ns: int, values: Sequence[float], covariance: float = 0.0) -> Any:
        return self.make(
            "sensor_msgs/msg/Imu",
            header=self.header(t_ns),
            orientation=self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.array([-1.0] + [0.0] * 8),
            angular_velocity=self.vector(values[3:6]),
            angular_velocity_covariance=np.array([covariance] + [0.0] * 8),
            linear_acceleration=self.vector(values[:3]),
            linear_acceleration_covariance=np.zeros(9),
        )

    def field(self, t_ns: int, micro_tesla: Sequence[float]) -> Any:
        return self.make(
            "sensor_msgs/msg/MagneticField",
            header=self.header(t_ns),
            magnetic_field=self.vector([value / 1e6 for value in micro_tesla]),
            magnetic_field_covariance=np.zeros(9),
        )

    def pressure(self, t_ns: int, pascal: float) -> Any:
        kind = "sensor_msgs/msg/FluidPressure"
        return self.make(kind, header=self.header(t_ns), fluid_pressure=pascal, variance=4.0)

    def range(self, t_ns: int, range_m: float, std_m: float = 0.0) -> Any:
        names = {field[0] for field in self.store.fielddefs["sensor_msgs/msg/Range"][1]}
        variance = {"variance": std_m**2} if "variance" in names else {}
        limits = {"radiation_type": 0, "field_of_view": 0.1, "min_range": 0.0, "max_range": 200.0}
        return self.make("sensor_msgs/msg/Range", header=self.header(t_ns), **limits, range=range_m, **variance)

    def uwb(self, t_ns: int, anchor: int, millimetres: int) -> Any:
        header = self.header(t_ns)
        return self.make(
            "uwb_msgs/msg/UwbRange", header=header, responder_id=anchor, distance_mm=millimetres, rssi=-80.0
        )


Stamped = tuple[int, str, Any]
"""UTC in ns, topic, message."""


def messages_of(recording: Recording, ros: Messages, own_type: bool = False) -> list[Stamped]:
    """Return the messages of a robot. own_type: its ranges are of a type that only it knows, in mm."""
    times, imu = imu_of(recording)
    found: list[Stamped] = []
    for t_ns, values in zip(times, imu.tolist(), strict=True):
        found += [(t_ns, "/imu/data", ros.imu(t_ns, values)), (t_ns, "/imu/mag", ros.field(t_ns, values[6:]))]
    for t_ns, anchor, range_m in ranges_of(recording):
        message = ros.uwb(t_ns, int(anchor), round(range_m * 1e3)) if own_type else ros.range(t_ns, range_m)
        found.append((t_ns, "/uwb", message))
    return sorted(found, key=lambda message: message[0])


def ros1_bag(path: Path, messages: Sequence[Stamped], ros: Messages) -> Path:
    with Writer1(path) as bag:
        topics = {topic: message for _, topic, message in messages}
        connections = {
            topic: bag.add_connection(topic, message.__msgtype__, typestore=ros.store)
            for topic, message in topics.items()
        }
        for t_ns, topic, message in messages:
            bag.write(connections[topic], t_ns, ros.store.serialize_ros1(message, message.__msgtype__))
    return path


def ros2_bag(path: Path, messages: Sequence[Stamped], ros: Messages, storage: StoragePlugin) -> Path:
    """Return the folder of the bag."""
    with Writer2(path, version=9, storage_plugin=storage) as bag:
        topics = {topic: message for _, topic, message in messages}
        connections = {
            topic: bag.add_connection(topic, message.__msgtype__, typestore=ros.store)
            for topic, message in topics.items()
        }
        for t_ns, topic, message in messages:
            bag.write(connections[topic], t_ns, ros.store.serialize_cdr(message, message.__msgtype__))
    return path


def json_mcap(path: Path, messages: Iterable[tuple[int, str, dict[str, Any]]], finish: bool = True) -> Path:
    """Write messages of JSON. finish: with the index at the end."""
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=2_000)
        writer.start()
        channels: dict[str, int] = {}
        for t_ns, topic, message in messages:
            if topic not in channels:
                schema = writer.register_schema(topic.strip("/"), "jsonschema", b"{}")
                channels[topic] = writer.register_channel(topic, "json", schema)
            writer.add_message(channels[topic], t_ns, json.dumps(message).encode(), t_ns)
        if finish:
            writer.finish()
    return path

"""Bags of ROS and MCAP files: topics are found or chosen, and their messages read."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from google.protobuf import descriptor_pb2
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores

from dropanchor_schemas.site import Anchor, Site
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    Frame,
    HeadingSample,
    ImuSample,
    PressureSample,
    RangeSample,
    anchor_number,
    encode_json,
    encode_packed,
)
from dropanchor_service.recording.folder import Limits
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.store import SiteStore, TagTable
from service.importing import formats
from service.importing.command import Import

T0, S = formats.T0_NS, 1_000_000_000
VALUES = [0.1, 0.2, 9.8, 0.01, 0.02, 0.5]


def robot(ros: formats.Messages, count: int = 100, with_field: bool = True) -> list[formats.Stamped]:
    """Return the messages of a robot with an IMU at 100 Hz, a magnetometer and ranges at 10 Hz."""
    found: list[formats.Stamped] = []
    for i in range(count):
        t_ns = T0 + i * S // 100
        found.append((t_ns, "/imu/data", ros.imu(t_ns, VALUES)))
        found += [(t_ns, "/imu/mag", ros.field(t_ns, (20.0, 0.0, -40.0)))] if with_field else []
        found += [(t_ns, "/uwb", ros.range(t_ns, 5.0 + i / 100))] if i % 10 == 0 else []
    return found


def ros1(path: Path) -> Path:
    ros = formats.Messages(Stores.ROS1_NOETIC)
    return formats.ros1_bag(path / "a.bag", robot(ros), ros)


def folder_of(store: Stores, storage: StoragePlugin) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        ros = formats.Messages(store)
        return formats.ros2_bag(path / "a", robot(ros), ros, storage)

    return write


def lone_mcap(path: Path) -> Path:
    return next(folder_of(Stores.ROS2_JAZZY, StoragePlugin.MCAP)(path).glob("*.mcap"))


def lone_db3(path: Path) -> Path:
    return next(folder_of(Stores.ROS2_HUMBLE, StoragePlugin.SQLITE3)(path).glob("*.db3"))


@pytest.mark.parametrize(
    "make",
    [
        ros1,
        folder_of(Stores.ROS2_JAZZY, StoragePlugin.MCAP),
        folder_of(Stores.ROS2_JAZZY, StoragePlugin.SQLITE3),
        folder_of(Stores.ROS2_HUMBLE, StoragePlugin.SQLITE3),
        lone_mcap,
        lone_db3,
    ],
)
def test_the_only_topics_that_fit_are_taken_from_every_kind_of_bag(run: Import, make: Callable[[Path], Path]) -> None:
    ended = run(make(run.folder))
    assert ended.status == 0, ended.error
    assert "uses --imu /imu/data --mag /imu/mag --range /uwb" in ended.printed
    assert "converted from T to uT (times 1000000)" in ended.printed
    first = ended.rows("imu")[0]
    assert [float(first[name]) for name in ("ax", "ay", "az", "gx", "gy", "gz")] == VALUES
    assert [float(first[name]) for name in ("mx", "my", "mz")] == pytest.approx([20, 0, -40])
    assert ended.column("range", "range_m") == pytest.approx([5 + i / 10 for i in range(10)])
    assert ended.rows("anchors") == [{"id": "1", "x": "0.0", "y": "0.0", "z": "0.0"}]


def test_the_variance_of_a_range_is_its_std_and_the_option_names_the_anchor(run: Import) -> None:
    ros = formats.Messages(Stores.ROS2_JAZZY)
    messages = [(T0 + i * S, "/uwb", ros.range(T0 + i * S, 5.0, std_m=0.2)) for i in range(3)]
    bag = formats.ros2_bag(run.folder / "a", messages, ros, StoragePlugin.MCAP)
    ended = run(bag, "--range", "/uwb=gate", "--anchor", "gate=1,2,3")
    assert ended.rows("range")[0]["anchor_id"] == "gate"
    assert ended.column("range", "std_m") == pytest.approx([0.2] * 3)


def test_several_candidates_are_listed_with_types_counts_and_rates(run: Import) -> None:
    ros = formats.Messages(Stores.ROS1_NOETIC)
    messages = robot(ros)
    messages += [(t_ns, "/imu/raw", message) for t_ns, topic, message in messages if topic == "/imu/data"]
    bag = formats.ros1_bag(run.folder / "a.bag", sorted(messages, key=lambda m: m[0]), ros)
    ended = run(bag)
    assert ended.status == 2
    assert "has 2 IMU topics: say which with --imu TOPIC" in ended.error
    assert "  /imu/raw  sensor_msgs/msg/Imu  100 messages, 101 Hz" in ended.error
    assert "  /uwb  sensor_msgs/msg/Range  10 messages" in ended.error
    assert run(bag, "--imu", "/imu/raw").status == 0


def test_a_topic_that_is_not_there_is_named_with_the_nearest(run: Import) -> None:
    ended = run(ros1(run.folder), "--imu", "/imu/dat")
    assert ended.status == 2
    assert "has no topic /imu/dat; did you mean /imu/data?" in ended.error


def test_ranges_of_a_type_of_its_own_are_read_by_their_fields(run: Import) -> None:
    ros = formats.Messages(Stores.ROS2_JAZZY)
    messages = [(T0 + i * S // 10, "/uwb", ros.uwb(T0 + i * S // 10, 7 + i % 2, 5000 + i)) for i in range(10)]
    bag = formats.ros2_bag(run.folder / "a", messages, ros, StoragePlugin.SQLITE3)
    places = ("--anchor", "7=0,0,0", "--anchor", "8=5,0,0")
    ended = run(bag, *places)
    assert ended.status == 0, ended.error
    assert "distance_mm: converted from mm to m (times 0.001)" in ended.printed
    assert ended.column("range", "range_m") == pytest.approx([5 + i / 1000 for i in range(10)])
    told = run(bag, "--range", "/uwb", "--map", "range=distance_mm:cm", "anchor=responder_id", *places, out="told")
    assert told.column("range", "range_m")[0] == 50.0
    assert {row["anchor_id"] for row in told.rows("range")} == {"7", "8"}


def test_several_anchors_without_positions_are_refused_with_what_to_give(run: Import) -> None:
    ros = formats.Messages(Stores.ROS2_JAZZY)
    messages = [(T0 + i * S, "/uwb", ros.uwb(T0 + i * S, 7 + i % 2, 5000)) for i in range(4)]
    ended = run(formats.ros2_bag(run.folder / "a", messages, ros, StoragePlugin.MCAP))
    assert ended.status == 2
    assert "the positions of the anchors 7 (2 ranges), 8 (2 ranges) are not known: give --anchor 7=X,Y,Z" in ended.error
    assert not ended.out.exists()


def test_messages_that_say_that_they_hold_nothing_are_left_out(run: Import) -> None:
    ros = formats.Messages(Stores.ROS2_JAZZY)
    messages = robot(ros, with_field=False)
    messages += [
        (T0 + 2 * S, "/imu/data", ros.imu(T0 + 2 * S, VALUES, covariance=-1.0)),
        (T0 + 2 * S, "/uwb", ros.range(T0 + 2 * S, float("inf"))),
        (T0 + 2 * S, "/uwb", ros.range(T0 + 2 * S, 500.0)),
    ]
    ended = run(formats.ros2_bag(run.folder / "a", messages, ros, StoragePlugin.MCAP))
    assert len(ended.rows("imu")) == 100
    assert "/imu/data: 1 left out: messages without gyroscope or accelerometer (line 101)" in ended.printed
    assert "/uwb: 1 left out: ranges that are not finite" in ended.printed
    assert "/uwb: 1 left out: ranges outside min_range and max_range" in ended.printed


def test_accelerations_of_a_driver_in_g_can_be_corrected(run: Import) -> None:
    ros = formats.Messages(Stores.ROS1_NOETIC)
    messages = [(T0 + i * S // 100, "/imu", ros.imu(T0 + i * S // 100, [0, 0, 1, 0, 0, 0])) for i in range(400)]
    bag = formats.ros1_bag(run.folder / "a.bag", messages, ros)
    assert "The accelerations look like g" in run(bag).printed
    words = [f"/imu/a{axis}=linear_acceleration.{axis}:g" for axis in "xyz"]
    words += [f"/imu/g{axis}=angular_velocity.{axis}" for axis in "xyz"]
    ended = run(bag, "--map", *words, out="told")
    assert ended.column("imu", "az") == pytest.approx([9.80665] * 400)


def lines_of_json(count: int = 200) -> list[tuple[int, str, dict[str, Any]]]:
    lines: list[tuple[int, str, dict[str, Any]]] = []
    for i in range(count):
        t_ns = T0 + i * S // 100
        stamp = {"sec": t_ns // S, "nsec": t_ns % S}
        acc, gyro = {"x": 0.0, "y": 0.1, "z": 9.8}, {"x": 0.0, "y": 0.0, "z": 0.5}
        lines.append((t_ns + 7, "/imu", {"timestamp": stamp, "acc": acc, "gyro": gyro}))
        lines.append((t_ns, "/uwb", {"anchor": "A", "distance": 5 + i / 100}))
        lines.append((t_ns, "/gps", {"latitude": 52.5}))
    return lines


def test_messages_of_json_are_read_by_their_fields_with_their_own_times(run: Import) -> None:
    ended = run(formats.json_mcap(run.folder / "a.mcap", lines_of_json()))
    assert ended.status == 0, ended.error
    assert ended.column("imu", "t_s")[:2] == [0.0, 0.01]
    assert ended.column("imu", "gz")[0] == 0.5
    assert ended.rows("range")[0] == {"t_s": "0.000000000", "anchor_id": "A", "range_m": "5", "std_m": ""}


def test_a_torn_file_is_read_up_to_the_tear(run: Import) -> None:
    path = formats.json_mcap(run.folder / "a.mcap", lines_of_json())
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    ended = run(path)
    assert ended.status == 0, ended.error
    assert "a.mcap is cut off or damaged" in ended.printed
    assert 20 < len(ended.rows("imu")) < 200


def test_messages_of_protobuf_are_read_by_their_descriptors(run: Import) -> None:
    file = descriptor_pb2.FileDescriptorProto(name="uwb.proto", package="lab", syntax="proto3")
    kind = file.message_type.add(name="Uwb")
    for number, (name, of) in enumerate((("anchor", 9), ("range_cm", 1)), 1):
        kind.field.add(name=name, number=number, type=of, label=1)
    path = run.folder / "a.mcap"
    with path.open("wb") as out:
        writer = McapWriter(out)
        writer.start()
        schema = writer.register_schema(
            "lab.Uwb", "protobuf", descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
        )
        channel = writer.register_channel("/uwb", "protobuf", schema)
        odd = writer.register_channel("/odd", "cbor", 0)
        for i in range(5):
            distance = b"\x0a\x01A" + b"\x11" + struct.pack("<d", 500.0 + i)
            writer.add_message(channel, T0 + i * S, distance, T0)
            writer.add_message(odd, T0 + i * S, b"", T0)
        writer.finish()
    ended = run(path)
    assert ended.status == 0, ended.error
    assert ended.column("range", "range_m") == pytest.approx([5.0, 5.01, 5.02, 5.03, 5.04])
    refused = run(path, "--imu", "/odd", out="odd")
    assert "the topic /odd cannot be read: the encoding cbor is not known here" in refused.error


def recorded(folder: Path, payloads: list[tuple[int, bytes, str]]) -> Path:
    """Return the recording of the service of payloads of the tags 0 and 1, as they came each second."""
    now_ns = T0
    tags = TagTable()
    for name in ("cart", "drone"):
        tags.register(name)
    site = SiteStore(Site(anchors=[Anchor(id="gate", x=1.0, y=2.0, z=3.0)]), {})
    limits = Limits(2**30, 3600 * S, 1000, 10**18, 2**40)
    recorder = Recorder(folder, limits, S // 5, tags, site, lambda: now_ns, {})
    recorder.start()
    for i, (row, payload, encoding) in enumerate(payloads):
        now_ns = T0 + i * S
        recorder.record_messages([(row, payload, encoding, now_ns)])
    recorder.stop()
    recorder.writer.flush()
    return recorder.folder / recorder.files()[0].name


def frame(i: int, boot_clock: bool = False) -> Frame:
    t_ns = i * S if boot_clock else T0 + i * S
    return Frame(
        imu=[ImuSample(t_ns, (0.0, 0.0, 9.75), (0.0, 0.0, 0.5), (20.0, 0.0, -40.0))],
        ranges=[RangeSample(t_ns, anchor_number("gate"), 5.0 + i, 0.125)],
        headings=[HeadingSample(t_ns, 0.5, float("nan"))],
        pressures=[PressureSample(t_ns, 101_325.0 - 12.5 * i, 21.5 if i else float("nan"))],
        sequence=i,
        boot_id=9,
        boot_clock=boot_clock,
    )


def test_a_recording_of_the_service_gives_the_samples_of_a_tag_and_the_anchors(run: Import) -> None:
    packed = [(0, encode_packed(frame(i)), ENCODING_PACKED) for i in (0, 1, 1, 2)]
    json_of_other = [(1, encode_json(Frame(ranges=[RangeSample(T0, anchor_number("gate"), 7.0, 0.5)])), ENCODING_JSON)]
    path = recorded(run.folder / "r", packed + json_of_other)
    refused = run(path)
    assert "has several tags, choose one with --tag: cart (4 messages), drone (1 messages)" in refused.error
    ended = run(path, "--tag", "cart")
    assert ended.status == 0, ended.error
    assert [row["range_m"] for row in ended.rows("range")] == ["5", "6", "7"]
    assert ended.rows("range")[0]["anchor_id"] == "gate"
    assert ended.rows("anchors") == [{"id": "gate", "x": "1.0", "y": "2.0", "z": "3.0"}]
    assert ended.column("imu", "az") == [9.75] * 3
    assert ended.column("heading", "yaw_rad") == [0.5] * 3
    assert ended.column("pressure", "pressure_pa") == [101_325.0, 101_312.5, 101_300.0]
    assert [row["temperature_c"] for row in ended.rows("pressure")] == ["", "21.5", "21.5"]


def test_a_clock_since_boot_is_set_by_the_arrival(run: Import) -> None:
    path = recorded(
        run.folder / "r", [(0, encode_packed(frame(i, boot_clock=True)), ENCODING_PACKED) for i in range(3)]
    )
    ended = run(path)
    assert "the times since boot are set to UTC by their arrival" in ended.printed
    assert f"--t0-ns {T0}" in ended.printed
    assert ended.column("range", "t_s") == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("name", ["a.bag", "a.db3", "a.mcap"])
def test_a_damaged_bag_is_one_sentence(run: Import, name: str) -> None:
    magic = {"a.bag": b"#ROSBAG V2.0\n", "a.db3": b"SQLite format 3\0", "a.mcap": b"\x89MCAP0\r\n"}[name]
    ended = run(run.file(name, magic + b"\x07" * 500))
    assert ended.status == 2
    assert len(ended.error.splitlines()) == 1
    assert name in ended.error

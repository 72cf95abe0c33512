"""A robot with ROS 2 is a tag: its samples become poses, and its poses are ROS messages.

The robot has its own router, and its own writer and reader of CDR."""

import signal
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from math import hypot, pi
from threading import Thread

import pytest

from dropanchor_service.cli import main
from support.patience import PATIENCE_S
from support.repeated import repeated
from support.ros2 import IMU, ODOMETRY, POSE, RANGE, TF, CdrReader, Robot, imu_cdr, range_cdr, read_pose
from support.service import Running, command, environment, running_service, settings_file
from support.vibration import shaken_acc, shaken_gyro
from support.zenoh_router import connected_session, free_endpoint, running_router, wait_until

TAG, DOMAIN, SPEED_MPS = "cart", 7, 1.0
TAGS = [TAG, "dds-cart"]
OPTIONS = ("--imu=/imu/data", "--forward=y", "--range=/uwb/range=7", "--namespace=cart/dropanchor")


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    config = settings_file(tmp_path_factory.mktemp("site"), TAGS)
    text = config.read_text()
    for tag in TAGS:
        text = text.replace(f'[tags."{tag}"]', f'[tags."{tag}"]\nheight_m = 0.2')
    config.write_text(text)
    with running_service("--config", str(config)) as running:
        yield running


@pytest.fixture(scope="module")
def ros_router() -> Iterator[str]:
    endpoint = free_endpoint()
    with running_router(endpoint):
        yield endpoint


@contextmanager
def running_bridge(service: Running, ros_router: str, *arguments: str) -> Iterator[list[str]]:
    """Run `dropanchor ros2` until the block ends. Yield the lines on stderr, which are complete after it."""
    places = ("--url", service.url, "--connect", service.zenoh, "--ros-connect", ros_router, "--domain", str(DOMAIN))
    said: list[str] = []
    words = command("ros2", "--tag", TAG, *places, *arguments)
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment()) as process:
        assert process.stderr is not None
        reader = Thread(target=said.extend, args=(process.stderr,))
        reader.start()
        try:
            wait_until(lambda: any("ready" in line for line in said) or process.poll() is not None)
            yield said
        finally:
            process.send_signal(signal.SIGTERM)
            assert process.wait(PATIENCE_S) == 0, said
            reader.join()


@contextmanager
def driving(robot: Robot) -> Iterator[None]:
    """Go north past the anchor from (10, -20) until the block ends.

    The y axis of the IMU points forward, and some messages are unusable.
    """
    began_s = time.monotonic()

    def publish(index: int) -> None:
        now_ns = time.time_ns()
        forward, left, up = shaken_acc()
        gyro_forward, gyro_left, gyro_up = shaken_gyro()
        robot.publish("imu/data", IMU, imu_cdr(now_ns, (-left, forward, up), (-gyro_left, gyro_forward, gyro_up)))
        if index % 5 == 0:
            distance_m = hypot(10.0, -20.0 + SPEED_MPS * (time.monotonic() - began_s))
            robot.publish("uwb/range", RANGE, range_cdr(now_ns, distance_m))
            robot.publish("uwb/range", RANGE, range_cdr(now_ns, float("inf")))

    with repeated(publish, 0.02):
        yield


@pytest.mark.parametrize(("tag", "dds"), [(TAGS[0], []), (TAGS[1], ["--dds"])], ids=["rmw_zenoh", "DDS"])
def test_a_robot_is_a_tag_and_gets_its_pose_with_covariance_odometry_and_tf(
    service: Running, ros_router: str, tag: str, dds: list[str]
) -> None:
    options = [*OPTIONS, "--tag", tag, *dds]
    with connected_session(ros_router) as session, running_bridge(service, ros_router, *options) as said:
        robot = Robot(session, DOMAIN, dds=bool(dds))
        keys = [
            robot.subscribe("cart/dropanchor/pose", POSE),
            robot.subscribe("cart/dropanchor/odometry", ODOMETRY),
            robot.subscribe("tf", TF),
        ]
        with driving(robot):
            wait_until(lambda: all(len(robot.received[key]) >= 10 for key in keys))
        pose, odometry, tf = (robot.received[key] for key in keys)

        reader = CdrReader(pose[-1][0])
        t_ns, frame = reader.stamp_and_frame()
        place, heading, covariance = read_pose(reader)
        reader.end()
        stored = service.get(f"/api/v1/tags/{tag}/pose?at={t_ns}")
        assert frame == "site"
        assert hypot(place[0] - stored["x"], place[1] - stored["y"]) < 0.05
        assert place[2] == 0.2
        assert heading == pytest.approx(stored["heading_rad"], abs=0.05)
        assert covariance[0] == pytest.approx(stored["covariance"][0][0], rel=0.2)

        reader = CdrReader(odometry[-1][0])
        assert reader.stamp_and_frame()[1] == "site"
        assert reader.text() == f"tag/{tag}"
        read_pose(reader)
        twist = reader.take("d", 6)
        assert reader.take("d", 36)[::7] == [1e6] * 6  # not known
        reader.end()
        assert twist[0] == pytest.approx(SPEED_MPS, abs=0.5)
        assert twist[1:5] == [0.0] * 4

        reader = CdrReader(tf[-1][0])
        assert reader.take("I") == [1]
        assert (reader.stamp_and_frame()[1], reader.text()) == ("site", f"tag/{tag}")
        assert hypot(*reader.take("d", 3)) < 40.0
        assert hypot(*reader.take("d", 4)) == pytest.approx(1.0)
        reader.end()

        attachments = [struct.unpack("<qqB16s", attachment) for _, attachment in pose]
        first = attachments[0][0]
        assert [sequence for sequence, *_ in attachments] == list(range(first, first + len(attachments)))
        assert {(length, gid) for _, _, length, gid in attachments} == {(16, attachments[0][3])}
        assert abs(attachments[-1][1] - t_ns) < 60 * 10**9
        assert abs(heading - pi / 2) < 0.7
    assert any("a range that is not finite" in line for line in said)
    told = [line.strip() for line in said if "published" in line]
    assert f"no pose is published: the service has none of tag {tag}" in told[0]
    assert told[-1].endswith("poses are published")
    assert "samples sent" in said[-1]


def test_the_node_announces_itself_and_its_topics_while_it_runs(service: Running, ros_router: str) -> None:
    with connected_session(ros_router) as session:
        robot = Robot(session, DOMAIN)
        with running_bridge(service, ros_router, *OPTIONS):
            wait_until(lambda: len(robot.tokens()) == 6)
            tokens = robot.tokens()
            ids = {token.split("/")[2] for token in tokens}
            assert len(ids) == 1
            (zid,) = ids
            place = f"@ros2_lv/{DOMAIN}/{zid}/0"
            named = {token.replace(place, "").partition("/%/%/dropanchor")[2] for token in tokens}
            assert named == {
                "",
                f"/%imu%data/{IMU}/::,10:,:,:,,",
                f"/%uwb%range/{RANGE}/::,10:,:,:,,",
                f"/%cart%dropanchor%pose/{POSE}/::,10:,:,:,,",
                f"/%cart%dropanchor%odometry/{ODOMETRY}/::,10:,:,:,,",
                f"/%tf/{TF}/::,10:,:,:,,",
            }
            assert f"{place}/0/NN/%/%/dropanchor" in tokens
            assert sum("/MS/" in token for token in tokens) == 2
            assert sum("/MP/" in token for token in tokens) == 3
        wait_until(lambda: not robot.tokens())


def test_it_says_why_no_pose_is_published(service: Running, ros_router: str) -> None:
    with (
        connected_session(ros_router) as session,
        running_bridge(service, ros_router, "--tag", "other", *OPTIONS) as said,
    ):
        robot = Robot(session, DOMAIN)
        wait_until(lambda: any("the service has none of tag other" in line for line in said))
        wait_until(lambda: len(robot.tokens()) == 6)

        def is_told() -> bool:
            robot.publish("uwb/range", RANGE, range_cdr(time.time_ns(), 3.0))
            return any("no pose is published while the state is initialising. " in line for line in said)

        wait_until(is_told)


def test_damaged_and_foreign_messages_are_named_and_harm_nothing(service: Running, ros_router: str) -> None:
    with connected_session(ros_router) as session, running_bridge(service, ros_router, *OPTIONS) as said:
        robot = Robot(session, DOMAIN)
        wait_until(lambda: len(robot.tokens()) == 6)
        now_ns = time.time_ns()
        whole = range_cdr(now_ns, 3.0)
        old = RANGE.replace("b42b", "0000")
        for _ in range(3):
            robot.publish("uwb/range", RANGE, whole[:-3])
            robot.publish("uwb/range", RANGE, b"")
            robot.publish("uwb/range", old, whole)
            robot.publish("imu/data", IMU, imu_cdr(now_ns, (0, 0, 9.8), (0, 0, 0), covariance=-1.0))
            session.put(f"{DOMAIN}/uwb/range/{RANGE}", range_cdr(now_ns, 200.0))
        robot.publish("imu/data", IMU, imu_cdr(0, (0, 0, 9.8), (0, 0, 0)), t_ns=now_ns)
        wait_until(lambda: sum("left out" in line for line in said) >= 4 and "outside" in "".join(said))
        before = service.get(f"/api/v1/tags/{TAG}")["samples"].get("imu", 0)
        robot.publish("imu/data", IMU, imu_cdr(0, (0, 0, 9.8), (0, 0, 0)))
        wait_until(lambda: service.get(f"/api/v1/tags/{TAG}")["samples"].get("imu", 0) > before)
    assert "2 samples sent" in said[-1]
    for reason in (
        "6 × a damaged sensor_msgs/msg/Range",
        "3 × a sensor_msgs/msg/Range with other fields than in ROS 2 Humble and Jazzy",
        "3 × an IMU message without angular_velocity, as angular_velocity_covariance[0] = -1 says",
        "3 × a range outside min_range and max_range",
    ):
        assert reason in said[-1]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([], "which tag is the robot?"),
        (["--tag=cart", "--forward=z"], "must be different axes"),
        (["--tag=cart", "--ros-connect=nonsense"], "nonsense"),
        (["--tag=cart", "--connect-timeout=0.5", f"--ros-connect={free_endpoint()}"], "Cannot connect to"),
    ],
)
def test_what_cannot_start_says_why(arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ros2", *arguments]) == 2
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("--imu=/im u", "not a ROS name"),
        ("--range=/uwb/range", "TOPIC=ANCHOR was expected"),
        ("--range=/9=1", "not a ROS name"),
        (f"--range=/uwb/range={'7' * 65}", "no id of an anchor"),
    ],
)
def test_a_bad_topic_is_refused(argument: str, expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["ros2", "--tag=cart", argument])
    assert expected in capsys.readouterr().err


def test_a_bad_domain_is_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "seven")
    with pytest.raises(SystemExit):
        main(["ros2", "--tag=cart"])
    assert "invalid int value: 'seven'" in capsys.readouterr().err

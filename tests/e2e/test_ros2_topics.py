"""`dropanchor ros2` beside nodes that publish something else: other topics, other types, another distribution."""

import math
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

import pytest
import zenoh

from support.commands import environment
from support.listening import listening
from support.patience import PATIENCE_S
from support.ros2 import IMU, RANGE, CdrWriter, Robot, imu_cdr, odometry_cdr, range_cdr
from support.service import command
from support.zenoh_router import connected_session, free_endpoint, free_port, running_router, wait_until

HUMBLE_IMU = f"{IMU.partition('/')[0]}/TypeHashNotSupported"
HUMBLE_RANGE = f"{RANGE.partition('/')[0]}/TypeHashNotSupported"
MAGNETIC_FIELD = "sensor_msgs::msg::dds_::MagneticField_/RIHS01_00"


@pytest.fixture(scope="module")
def router() -> Iterator[str]:
    """The router of the nodes and of the service."""
    endpoint = free_endpoint()
    with running_router(endpoint):
        yield endpoint


@contextmanager
def bridge(router: str, *arguments: str) -> Iterator[list[str]]:
    """Run `dropanchor ros2` without a service until the block ends. Yield the lines on stderr."""
    places = ("--url", f"http://127.0.0.1:{free_port()}", "--connect", router, "--ros-connect", router)
    said: list[str] = []
    words = command("ros2", "--tag", "cart", *places, *arguments)
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment()) as process:
        assert process.stderr is not None
        reader = Thread(target=said.extend, args=(process.stderr,))
        reader.start()
        try:
            wait_for(said, "ready")
            yield said
        finally:
            process.send_signal(signal.SIGTERM)
            assert process.wait(PATIENCE_S) == 0, said
            reader.join()


def wait_for(said: list[str], text: str) -> None:
    wait_until(lambda: any(text in line for line in said))


def announce(session: zenoh.Session, domain: int, topic: str, of: str) -> zenoh.LivelinessToken:
    """Announce a publisher of the node `driver`."""
    place = f"@ros2_lv/{domain}/{session.info.zid()}/0/3/MP/%/%/driver"
    return session.liveliness().declare_token(f"{place}/%{topic.replace('/', '%')}/{of}/::,10:,:,:,,")


def humble_range_cdr(t_ns: int, range_m: float) -> bytes:
    return CdrWriter().header(t_ns, "uwb").add("B", 0).add("f", 0.1, 0.0, 100.0, range_m).cdr


def test_nodes_of_humble_are_read_and_named_and_accelerations_that_are_all_zero_are_not_published(router: str) -> None:
    with (
        listening(router) as heard,
        connected_session(router) as session,
        bridge(router, "--domain=3", "--imu=/imu/data", "--range=/uwb/range=7") as said,
    ):
        robot = Robot(session, 3)
        for index in range(4):
            t_ns = time.time_ns()
            robot.publish("imu/data", HUMBLE_IMU, imu_cdr(t_ns, (0, 0, 9.8 if index else 0.0), (0, 0, 0.1)))
            robot.publish("uwb/range", HUMBLE_RANGE, humble_range_cdr(t_ns, 3.5))
        wait_until(lambda: sum(len(frame.imu) for frame in heard.frames) == 3)
        wait_until(lambda: sum(len(frame.ranges) for frame in heard.frames) == 4)
    assert {(one.anchor, one.range_m) for frame in heard.frames for one in frame.ranges} == {(7, 3.5)}
    assert {round(one.acc[2], 3) for frame in heard.frames for one in frame.imu} == {9.8}
    assert sum("these nodes run ROS 2 Humble" in line for line in said) == 1
    assert "7 samples sent; left out: 1 × an IMU message whose linear_acceleration is 0 along all axes" in said[-1]


def test_nodes_behind_a_bridge_to_dds_are_read_and_see_what_is_published(router: str) -> None:
    options = ("--dds=/bot", "--imu=/imu/data", "--range=/uwb/range=7", "--odometry=/odom=90", "--pressure=/air")
    with (
        listening(router) as heard,
        connected_session(router) as session,
        bridge(router, *options) as said,
    ):
        robot = Robot(session, dds=True)
        token = f"@/{session.info.zid()}/@ros2_lv/MP/bot§mag/sensor_msgs§msg§MagneticField/:1:0:0,10"
        kept = session.liveliness().declare_token(token)
        wait_until(lambda: any("/MS/bot§air/" in token for token in robot.tokens()))  # the last that it declares
        t_ns = time.time_ns()
        robot.publish("bot/imu/data", "", imu_cdr(t_ns, (0, 0, 9.8), (0, 0, 0.1)))
        robot.publish("imu/data", "", imu_cdr(t_ns, (0, 0, 9.7), (0, 0, 0.1)))  # of another robot
        for cdr in (range_cdr(t_ns, 3.5), humble_range_cdr(t_ns + 1000, 4.5), b"", range_cdr(t_ns, 5.5)[:-6]):
            robot.publish("bot/uwb/range", "", cdr)
        half = math.radians(30.0) / 2
        robot.publish("bot/odom", "", odometry_cdr(t_ns, (0, 0, math.sin(half), math.cos(half)), 0.0625))
        robot.publish("bot/odom", "", odometry_cdr(t_ns, (0, 0, 0, 0)))
        wait_until(lambda: sum(len(one.imu) + len(one.ranges) + len(one.headings) for one in heard.frames) == 4)
        wait_for(said, "no message of /air comes: no node publishes it. These are published: /mag (sensor_msgs/msg/Mag")
        tokens = {token.partition("@ros2_lv")[2] for token in robot.tokens()}
        kept.undeclare()
    assert {
        "",
        "/MS/bot§imu§data/sensor_msgs§msg§Imu/:1:0:0,10",
        "/MP/bot§dropanchor§pose/geometry_msgs§msg§PoseWithCovarianceStamped/:1:0:0,10",
        "/MP/bot§tf/tf2_msgs§msg§TFMessage/:1:0:0,10",
    } < tokens
    ranges = [(one.anchor, one.range_m) for frame in heard.frames for one in frame.ranges]
    (heading,) = (one for frame in heard.frames for one in frame.headings)
    assert sorted(ranges) == [(7, 3.5), (7, 4.5)]
    assert heading.heading_rad == pytest.approx(math.radians(120))
    assert heading.std_rad == pytest.approx(0.25)
    assert "4 samples sent; left out: 2 × a damaged sensor_msgs/msg/Range" in said[-1]
    assert "1 × an odometry message whose orientation is no rotation" in said[-1]


def test_of_a_silent_topic_it_is_told_what_is_published_instead_and_when_it_comes(router: str) -> None:
    with connected_session(router) as session:
        tokens = [
            announce(session, 4, "camera/imu", IMU),
            announce(session, 4, "mag", MAGNETIC_FIELD),
            announce(session, 4, "uwb", RANGE),
        ]
        with bridge(router, "--domain=4", "--imu=/imu/data", "--range=/mag=7", "--range=/uwb=8") as said:
            wait_for(said, "no message of /uwb comes, although the node driver publishes it")
            Robot(session, 4).publish("imu/data", IMU, imu_cdr(time.time_ns(), (0, 0, 9.8), (0, 0, 0)))
            wait_for(said, "messages of /imu/data come")
    assert len(tokens) == 3
    assert [line.partition("no message of ")[2].strip() for line in said if "no message of" in line] == [
        "/imu/data comes: no node publishes it. These are published: /camera/imu (sensor_msgs/msg/Imu), "
        "/mag (sensor_msgs/msg/MagneticField), /uwb (sensor_msgs/msg/Range)",
        "/mag comes: it is published as sensor_msgs/msg/MagneticField, and sensor_msgs/msg/Range is needed",
        "/uwb comes, although the node driver publishes it: does its sensor give anything?",
    ]

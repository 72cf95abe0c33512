"""`dropanchor ros2`: a robot with ROS 2 as a tag, without a ROS installation."""

import argparse
import math
import os
import re
import sys
import time
from collections.abc import Mapping
from contextlib import ExitStack
from threading import Event, Thread
from typing import Any
from urllib.parse import quote

from dropanchor_schemas.epochs import EpochFence
from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id
from dropanchor_service.bridges.frames import tag_frame_id
from dropanchor_service.bridges.rmw_zenoh import RmwZenoh
from dropanchor_service.bridges.ros2dds import Ros2Dds, RosKeys
from dropanchor_service.bridges.ros_messages import RosMessages, is_usable
from dropanchor_service.commands.options import positive
from dropanchor_service.commands.rest import KEY_VARIABLE, RefusedError, asked
from dropanchor_service.commands.ros_node import RosNode
from dropanchor_service.commands.ros_samples import SampleInput
from dropanchor_service.runtime.signals import interrupts
from dropanchor_tag_client import TagClient
from dropanchor_tag_client.options import add_connection_options, apply_defaults, opened_client, opened_session
from dropanchor_tag_client.session import ConnectError
from dropanchor_tag_client.sources.axes import AXES, Mounting, mounting

DESCRIPTION = f"""\
Makes a robot with ROS 2 a tag. Its nodes must use rmw_zenoh (RMW_IMPLEMENTATION=rmw_zenoh_cpp, ROS 2 Jazzy or newer;
of ROS 2 Humble samples are read, and its nodes do not see the poses), or DDS behind zenoh-bridge-ros2dds: --dds.
Reads sensor_msgs/Imu, sensor_msgs/Range, and the heading of nav_msgs/Odometry, and publishes the tag's pose as
geometry_msgs/PoseWithCovarianceStamped, nav_msgs/Odometry and TF. If the service requires an API key for poses, set the
environment variable {KEY_VARIABLE}.
"""
EPILOG = """\
published topics (with --namespace dropanchor), while the state is tracking, coasting or degraded:
  /dropanchor/pose       geometry_msgs/PoseWithCovarianceStamped   in the frame site
  /dropanchor/odometry   nav_msgs/Odometry                         while speed and yaw rate are known
  /tf                    tf2_msgs/TFMessage                        from site to --child-frame; --no-tf: not

While north is unknown, the state is `relative` and no pose is published: it would be no place of the site.

examples:
  dropanchor ros2 --tag cart --imu /imu/data --range /uwb/range=1
  dropanchor ros2 --tag cart --imu /imu/data --forward=-y --range /uwb/left=1 --range /uwb/right=2
  dropanchor ros2 --tag cart --dds --imu /imu/data --range /uwb/range=1 --ros-connect tcp/127.0.0.1:7448
  dropanchor ros2 --tag cart --namespace cart/dropanchor --child-frame cart/base_link     poses only
  dropanchor ros2 --credentials cart/ --url https://yard.example:8080 --ros-connect tcp/127.0.0.1:7447
"""
REFUSED = (ConnectError, ValueError, OSError)

Json = Mapping[str, Any]

ROS_CONNECT = "tcp/127.0.0.1:7447"
DOMAIN_VARIABLE = "ROS_DOMAIN_ID"
_NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_NODE = "dropanchor"
_TAKE_S = 0.1
_REPORT_S = 1.0
_SETTINGS_S = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--tag", help="id of the tag (default: the one of --credentials)")
    ros = parser.add_argument_group("ROS 2")
    ros.add_argument(
        "--ros-connect", default=ROS_CONNECT, metavar="ENDPOINT", help="router of the ROS nodes (default: %(default)s)"
    )
    ros.add_argument(
        "--domain",
        type=int,
        default=os.environ.get(DOMAIN_VARIABLE) or "0",
        help=f"ROS domain (default: {DOMAIN_VARIABLE}, or 0)",
    )
    ros.add_argument(
        "--dds",
        nargs="?",
        const="/",
        metavar="NAMESPACE",
        help="the nodes use DDS, and zenoh-bridge-ros2dds listens at --ros-connect; NAMESPACE: as in its configuration",
    )
    _add_sensors(ros)
    ros.add_argument("--namespace", type=_topic, default="dropanchor", help="of the published topics (%(default)s)")
    ros.add_argument("--child-frame", metavar="FRAME", help="frame that moves with the tag (default: tag/TAG)")
    ros.add_argument("--no-tf", action="store_true", help="do not publish TF: something else does")
    ros.add_argument("--max-hz", type=positive, default=20, metavar="HZ", help="poses per second (default: 20)")
    add("--url", default="http://127.0.0.1:8080", help="URL of the service, for poses (default: %(default)s)")
    add_connection_options(parser)


def _add_sensors(ros: argparse._ArgumentGroup) -> None:
    ros.add_argument("--imu", type=_topic, metavar="TOPIC", help="read sensor_msgs/Imu from this topic")
    ros.add_argument("--forward", choices=AXES, default="x", help="axis of the IMU that points forward (default: x)")
    ros.add_argument("--up", choices=AXES, default="z", help="axis of the IMU that points up (default: z)")
    ros.add_argument(
        "--range",
        type=_range_topic,
        action="append",
        default=[],
        metavar="TOPIC=ANCHOR",
        help="read sensor_msgs/Range to this anchor from this topic; may be repeated",
    )
    ros.add_argument(
        "--odometry",
        type=_odometry_topic,
        metavar="TOPIC=DEGREES",
        help="read the heading of nav_msgs/Odometry; DEGREES: counter-clockwise from east to the x axis of its frame",
    )
    ros.add_argument("--pressure", type=_topic, metavar="TOPIC", help="read sensor_msgs/FluidPressure from this topic")


def run(arguments: argparse.Namespace) -> None:
    """Bridge until Ctrl-C or SIGTERM. Raises REFUSED."""
    apply_defaults(arguments)
    if arguments.tag is None:
        raise ValueError("which tag is the robot? --tag says so, or --credentials")
    mounted = mounting(arguments.forward, arguments.up)
    _say(f"connecting to the router of the ROS nodes at {arguments.ros_connect} (--ros-connect)")
    with ExitStack() as stack:
        keys = Ros2Dds(arguments.dds) if arguments.dds else RmwZenoh(arguments.domain)
        node = RosNode(stack.enter_context(opened_session(_ros_options(arguments))).session, keys, _NODE)
        reads = arguments.imu or arguments.range or arguments.odometry or arguments.pressure
        client = stack.enter_context(opened_client(arguments, arguments.tag)) if reads else None
        _bridge(arguments, node, keys, client, mounted)


def _ros_options(arguments: argparse.Namespace) -> argparse.Namespace:
    """Return the connection options for the router of the ROS nodes, which knows no credentials of ours."""
    without = dict.fromkeys(("ca", "cert", "key", "user"))
    return argparse.Namespace(connect=arguments.ros_connect, connect_timeout=arguments.connect_timeout, **without)


def _bridge(
    arguments: argparse.Namespace, node: RosNode, keys: RosKeys, client: TagClient | None, mounted: Mounting
) -> None:
    messages, stop = RosMessages(), Event()
    poses = Thread(target=PoseOutput(arguments, node, messages).run, args=(stop,), name="poses")
    with interrupts() as interrupt:
        samples = None if client is None else SampleInput(arguments, node, keys, messages, client, mounted, _say)
        poses.start()
        try:
            _say(f"ready: domain {arguments.domain} at {arguments.ros_connect}, tag {arguments.tag}")
            while not interrupt.wait_for(0.0 if samples else _TAKE_S):
                if samples:
                    samples.take()
        finally:
            stop.set()
            poses.join()
            if samples:
                _say(samples.summary())


class PoseOutput:
    """Publishes each new pose of the tag to ROS."""

    def __init__(self, arguments: argparse.Namespace, node: RosNode, messages: RosMessages) -> None:
        self._arguments = arguments
        self._messages = messages
        self._child_frame = arguments.child_frame or tag_frame_id(arguments.tag)
        self._pose = node.publisher(f"{arguments.namespace}/pose", messages.pose)
        self._odometry = node.publisher(f"{arguments.namespace}/odometry", messages.odometry)
        self._tf = None if arguments.no_tf else node.publisher("tf", messages.tf)
        self._t_ns = 0
        self._fence = EpochFence()
        self._height_m = 0.0
        self._settings_s = 0.0
        self._away = False
        self._told = ""

    def run(self, stop: Event) -> None:
        """Ask the service until `stop` is set. Say once that it is away, and once that it is back."""
        while not stop.is_set():
            began_s = time.monotonic()
            try:
                self.update()
                if self._away:
                    _say("the service answers again")
                self._away = False
            except RefusedError as error:
                if not self._away:
                    _say(f"{error}. Still trying.")
                self._away = True
            took_s = time.monotonic() - began_s
            stop.wait(max(1 / self._arguments.max_hz - took_s, took_s, 1.0 if self._away else 0.0))

    def update(self) -> None:
        """Publish the latest pose if it is new and usable. Raises RefusedError."""
        tag = quote(self._arguments.tag, safe="")
        poses = asked(self._arguments, "GET", f"/poses?tags={tag}")["poses"]
        self._tell(poses)
        for pose in poses:
            if time.monotonic() >= self._settings_s:
                self._height_m = asked(self._arguments, "GET", f"/tags/{tag}")["settings"]["height_m"]
                self._settings_s = time.monotonic() + _SETTINGS_S
            if not self._fence.accepts(tag, pose.get("epoch", 0)):
                continue
            if pose["t_ns"] != self._t_ns and is_usable(pose):
                self._t_ns = pose["t_ns"]
                self._publish(pose)

    def _tell(self, poses: list[Json]) -> None:
        """Say whether poses are published, and why not, when that changes."""
        text = f"no pose is published: the service has none of tag {self._arguments.tag}"
        for pose in poses:
            why_not = f"no pose is published while the state is {pose['state']}. {pose['hint']}"
            text = "poses are published" if is_usable(pose) else why_not.strip()
        if text != self._told:
            self._told = text
            _say(text)

    def _publish(self, pose: Json) -> None:
        height_m = self._height_m if pose.get("z") is None else pose["z"]
        self._pose(self._messages.pose_cdr(pose, height_m))
        if pose["speed_mps"] is not None and pose["yaw_rate_radps"] is not None:
            self._odometry(self._messages.odometry_cdr(pose, height_m, self._child_frame))
        if self._tf is not None:
            self._tf(self._messages.tf_cdr(pose, height_m, self._child_frame))


def _topic(text: str) -> str:
    if not _NAME.fullmatch(text):
        raise argparse.ArgumentTypeError(f"{text!r} is not a ROS name, such as /imu/data")
    return text


def _range_topic(text: str) -> tuple[str, str]:
    topic, _, anchor = text.partition("=")
    if not anchor:
        raise argparse.ArgumentTypeError(f"{text!r}: TOPIC=ANCHOR was expected, such as /uwb/range=1")
    try:
        chunk_from_id(anchor)
    except InvalidKeyError as error:
        raise argparse.ArgumentTypeError(f"{anchor!r} is no id of an anchor: {error}") from error
    return _topic(topic), anchor


def _odometry_topic(text: str) -> tuple[str, float]:
    topic, _, degrees = text.partition("=")
    try:
        return _topic(topic), math.radians(float(degrees))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: TOPIC=DEGREES was expected, such as /odom=90") from error


def _say(text: str) -> None:
    sys.stderr.write(f"dropanchor ros2: {text}\n")
    sys.stderr.flush()

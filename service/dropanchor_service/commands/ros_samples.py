"""Messages of a robot's sensors become samples of its tag."""

import argparse
import time
from collections import Counter
from collections.abc import Callable
from functools import partial

from dropanchor_service.bridges.rmw_zenoh import NO_TYPE_HASH
from dropanchor_service.bridges.ros2dds import RosKeys
from dropanchor_service.bridges.ros_messages import RosMessages, UnusableError
from dropanchor_service.commands.ros_node import Received, RosNode
from dropanchor_service.commands.ros_silence import SilenceWatch
from dropanchor_tag_client import TagClient
from dropanchor_tag_client.sources.axes import Mounting

HUMBLE = (
    "these nodes run ROS 2 Humble, whose keys have no type hashes: sensor_msgs/Imu and sensor_msgs/Range are read. The "
    "nodes do not see the poses, which are published with the type hashes of ROS 2 Jazzy"
)
_TAKE_S = 0.1
_REPORT_S = 1.0


class SampleInput:
    """Turns messages of the configured topics into samples of the tag."""

    def __init__(
        self,
        arguments: argparse.Namespace,
        node: RosNode,
        keys: RosKeys,
        messages: RosMessages,
        client: TagClient,
        mounted: Mounting,
        say: Callable[[str], None],
    ) -> None:
        self._node = node
        self._messages = messages
        self._client = client
        self._mounted = mounted
        self._say = say
        self._rejected: Counter[str] = Counter()
        self._told: Counter[str] = Counter()
        self._tell_s = 0.0
        self._is_humble = False
        wanted = self._subscribed(arguments)
        self._silence = SilenceWatch(wanted, keys, arguments.ros_connect, node.publishers_of_others, time.monotonic())

    def _subscribed(self, arguments: argparse.Namespace) -> dict[str, str]:
        """Subscribe to the topics that were asked for. Return the type of each."""
        node, messages, wanted = self._node, self._messages, {}
        if arguments.imu:
            node.subscribe(arguments.imu, messages.imu, self._imu)
            wanted[arguments.imu] = messages.imu.name
        for topic, anchor in arguments.range:
            node.subscribe(topic, messages.range, partial(self._range, anchor))
            wanted[topic] = messages.range.name
        if arguments.odometry:
            topic, x_rad = arguments.odometry
            node.subscribe(topic, messages.odometry, partial(self._odometry, x_rad))
            wanted[topic] = messages.odometry.name
        if arguments.pressure:
            node.subscribe(arguments.pressure, messages.pressure, self._pressure)
            wanted[arguments.pressure] = messages.pressure.name
        return wanted

    def take(self) -> None:
        """Publish the sample of the next message, if one comes soon. Say now and then what was left out or lacks."""
        received = self._node.take(_TAKE_S)
        if received is not None:
            self._note(received)
            try:
                received.handle(received)
            except UnusableError as error:
                self._rejected[str(error)] += 1
        for sentence in self._silence.sentences(time.monotonic()):
            self._say(sentence)
        if time.monotonic() >= self._tell_s and self._rejected != self._told:
            self._tell_s = time.monotonic() + _REPORT_S
            for reason, count in (self._rejected - self._told).items():
                self._say(f"left out {count} × {reason}")
            self._told = self._rejected.copy()

    def summary(self) -> str:
        """Return what became of all messages."""
        left_out = [f"{count} × {reason}" for reason, count in sorted(self._rejected.items())]
        left_out += [f"{count} × {reason}" for reason, count in sorted(self._client.refused.items())]
        left_out += [f"{self._node.lost} that came too fast"] if self._node.lost else []
        return f"{self._client.sent.samples} samples sent; left out: {', '.join(left_out) or 'none'}"

    def _note(self, received: Received) -> None:
        """Say that a silent topic is back, and once that the nodes run ROS 2 Humble."""
        sentence = self._silence.heard(received.topic, time.monotonic())
        if sentence:
            self._say(sentence)
        if received.type_hash == NO_TYPE_HASH and not self._is_humble:
            self._is_humble = True
            self._say(HUMBLE)

    def _imu(self, received: Received) -> None:
        sample = self._messages.imu_sample(received.cdr, received.t_ns, received.type_hash)
        acc, gyro = self._mounted.to_body(sample.acc), self._mounted.to_body(sample.gyro)
        self._client.publish_imu(acc, gyro, t_ns=sample.t_ns)

    def _range(self, anchor: str, received: Received) -> None:
        sample = self._messages.range_sample(received.cdr, received.t_ns, anchor, received.type_hash)
        self._client.publish_range(anchor, sample.range_m, t_ns=sample.t_ns, std_m=sample.std_m)

    def _odometry(self, x_rad: float, received: Received) -> None:
        sample = self._messages.heading_sample(received.cdr, received.t_ns, x_rad, received.type_hash)
        self._client.publish_heading(sample.heading_rad, t_ns=sample.t_ns, std_rad=sample.std_rad)

    def _pressure(self, received: Received) -> None:
        sample = self._messages.pressure_sample(received.cdr, received.t_ns, received.type_hash)
        self._client.publish_pressure(sample.pressure_pa, t_ns=sample.t_ns)

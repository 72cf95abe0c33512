"""What a bag offers: topics, and their messages."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

NS_PER_S = 1_000_000_000
IMU, MAG, RANGE = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField", "sensor_msgs/msg/Range"
PRESSURE = "sensor_msgs/msg/FluidPressure"


@dataclass(frozen=True)
class Topic:
    """type: of its messages, as sensor_msgs/msg/Imu. seconds: how long the bag is. problem: why its messages cannot be
    read, empty if they can."""

    name: str
    type: str
    count: int
    seconds: float
    problem: str = ""

    def __str__(self) -> str:
        rate = f"{self.count / self.seconds:.3g} Hz" if self.seconds > 0 else "?"
        return f"{self.name}  {self.type}  {self.count} messages, {rate}" + (f"  ({self.problem})" * bool(self.problem))


class Message(NamedTuple):
    """t_ns: when it was recorded, UTC. content: an object or a mapping, None if it is damaged."""

    topic: str
    t_ns: int
    content: Any


class Bag(Protocol):
    """notes: what is to be said of the file, complete once its messages were read."""

    @property
    def topics(self) -> Sequence[Topic]: ...

    @property
    def notes(self) -> Sequence[str]: ...

    def messages(self, topics: Collection[str]) -> Iterator[Message]: ...


def normal(name: str) -> str:
    """Return the name of a type as ROS 2 spells it: sensor_msgs/msg/Imu for sensor_msgs/Imu."""
    package, slash, rest = name.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else name

"""Which topics of a bag hold the IMU, the magnetometer, the barometer and the ranges."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from dropanchor_service.importing.bags.bag import IMU, MAG, PRESSURE, RANGE, Bag, Message, Topic
from dropanchor_service.importing.bags.topic_table import TopicTable, columns_of
from dropanchor_service.importing.readings import ImportingError
from dropanchor_service.importing.tables.guess import guessed
from dropanchor_service.importing.tables.mapping import WIDE
from dropanchor_tag_client.command_line import did_you_mean

_SAMPLE = 5
_SEARCH = 100_000  # messages that are read to see what topics hold
_KNOWN = {IMU: "imu", MAG: "mag", RANGE: "range", PRESSURE: "pressure"}
_NO_SENSORS: tuple[str, ...] = ("sensor_msgs/", "nav_msgs/", "geometry_msgs/", "tf2_msgs/", "tf/", "std_msgs/")
_NO_SENSORS += (
    "rosgraph_msgs/",
    "rcl_interfaces/",
    "visualization_msgs/",
    "diagnostic_msgs/",
    "foxglove",
    "dynamic_reconfigure/",
)


@dataclass
class Chosen:
    """imu, mag, pressure: topics, None for none. ranges: topics, each with its anchor, None if the messages name it."""

    imu: str | None = None
    mag: str | None = None
    ranges: list[tuple[str, str | None]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    pressure: str | None = None

    @property
    def all(self) -> list[str]:
        return [name for name in (self.imu, self.mag, self.pressure) if name] + [topic for topic, _ in self.ranges]


def tables_of(bag: Bag, names: Collection[str], path: object) -> dict[str, TopicTable]:
    """Return the tables of these topics. Raises ImportingError for one that is not there or cannot be read."""
    topics = {topic.name: topic for topic in bag.topics}
    for name in names:
        if name not in topics:
            raise ImportingError(f"{path} has no topic {name}{did_you_mean(name, topics)}\n{listed(bag.topics)}")
        if topics[name].problem:
            raise ImportingError(f"{path}: the topic {name} cannot be read: {topics[name].problem}")
    samples = _samples(bag, names)
    return {
        name: TopicTable(name, topics[name].type, topics[name].count, columns_of(messages, topics[name].type), bag)
        for name, messages in samples.items()
    }


def choose(bag: Bag, told: Chosen, path: object) -> Chosen:
    """Return the told topics, and where none is told the only one that fits. Raises ImportingError."""
    roles = _roles(bag)
    by_role = {role: [name for name, found in roles.items() if found == role] for role in _KNOWN.values()}
    chosen = Chosen(told.imu, told.mag, list(told.ranges))
    if chosen.imu is None:
        chosen.imu = _only(by_role["imu"], "IMU topics: say which with --imu TOPIC", bag, path)
    if not chosen.ranges:
        only = _only(by_role["range"], "topics with ranges: say to which anchor, with --range TOPIC=ANCHOR", bag, path)
        chosen.ranges = [(only, None)] if only else []
    if chosen.mag is None and len(by_role["mag"]) == 1:
        chosen.mag = by_role["mag"][0]
    elif chosen.mag is None and by_role["mag"]:
        chosen.notes.append(f"not used: {', '.join(by_role['mag'])} (--mag TOPIC chooses a magnetometer)")
    if len(by_role["pressure"]) == 1:
        chosen.pressure = by_role["pressure"][0]
        chosen.notes.append(f"pressures from {chosen.pressure}")
    elif by_role["pressure"]:
        chosen.notes.append(f"not used: {', '.join(by_role['pressure'])} (several barometers)")
    if not chosen.all:
        raise ImportingError(
            f"{path} has no topic that is known as an IMU or as ranges. Choose with --imu TOPIC and --range "
            f"TOPIC=ANCHOR, and say with --map what their fields hold:\n{listed(bag.topics)}"
        )
    return chosen


def listed(topics: Sequence[Topic]) -> str:
    return "\n".join(f"  {topic}" for topic in sorted(topics, key=lambda topic: topic.name))


def _only(names: Sequence[str], what: str, bag: Bag, path: object) -> str | None:
    if len(names) > 1:
        raise ImportingError(f"{path} has {len(names)} {what}\n{listed(bag.topics)}")
    return names[0] if names else None


def _roles(bag: Bag) -> dict[str, str]:
    """Return what topics hold by their type, or by the names of the fields of their first messages."""
    roles = {topic.name: _KNOWN[topic.type] for topic in bag.topics if topic.type in _KNOWN and topic.count}
    others = [
        t.name for t in bag.topics if t.type not in _KNOWN and not t.problem and not t.type.startswith(_NO_SENSORS)
    ]
    for name, messages in _samples(bag, others).items():
        if role := _role(columns_of(messages, ""), name):
            roles[name] = role
    return roles


def _role(columns: Sequence[str], name: str) -> str | None:
    try:
        fields = guessed(columns, name)
    except ImportingError:
        return None
    if {"ax", "gx"} <= set(fields):
        return "imu"
    if any(field == "range" or field.startswith(WIDE) for field in fields):
        return "range"
    return "mag" if "mx" in fields else None


def _samples(bag: Bag, names: Collection[str]) -> dict[str, list[Message]]:
    """Return the first messages of each topic."""
    samples: dict[str, list[Message]] = {name: [] for name in names}
    for count, message in enumerate(bag.messages(names) if names else ()):
        if len(samples[message.topic]) < _SAMPLE and message.content is not None:
            samples[message.topic].append(message)
        if count > _SEARCH or all(len(found) == _SAMPLE for found in samples.values()):
            break
    return samples

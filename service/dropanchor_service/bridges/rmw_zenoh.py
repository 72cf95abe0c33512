"""How ROS 2 nodes with rmw_zenoh name topics, announce themselves and number messages.

Source: docs/design.md, liveliness_utils.cpp and attachment_helpers.cpp of ros2/rmw_zenoh, from Jazzy on. ROS 2 Humble
has no type hashes; its keys have a fixed text in their place.
"""

import struct
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from xxhash import xxh3_128_digest

_ATTACHMENT = struct.Struct("<qqB16s")  # sequence number, source timestamp in ns UTC, length of the gid, gid
_GID_BYTES = 16
_DEPTH = 10
NO_TYPE_HASH = "TypeHashNotSupported"
"""What the keys of ROS 2 Humble have in the place of the type hash."""
_PUBLISHER = "MP"
_TOKEN_PARTS = 13
_QOS = f"::,{_DEPTH}:,:,:,,"  # reliable, volatile, keep last; no deadline, lifespan or lease


class RosType(NamedTuple):
    """A message type. name: such as `sensor_msgs/msg/Imu`. type_hash: `RIHS01_…`."""

    name: str
    type_hash: str

    @property
    def dds_name(self) -> str:
        package, kind, name = self.name.split("/")
        return f"{package}::{kind}::dds_::{name}_"


class Announced(NamedTuple):
    """A publisher of a node. session: the Zenoh id. topic: with a slash at its begin. type_name: as in `RosType`."""

    domain: str
    session: str
    node: str
    topic: str
    type_name: str


class Attachment(NamedTuple):
    """What accompanies every message. rmw_zenoh drops messages without it."""

    sequence: int
    t_ns: int
    gid: bytes

    def packed(self) -> bytes:
        return _ATTACHMENT.pack(self.sequence, self.t_ns, _GID_BYTES, self.gid)


def attachment_from(data: bytes) -> Attachment | None:
    """Return the attachment, None if it has another form."""
    if len(data) != _ATTACHMENT.size:
        return None
    sequence, t_ns, length, gid = _ATTACHMENT.unpack(data)
    return Attachment(sequence, t_ns, gid) if length == _GID_BYTES else None


@dataclass(frozen=True)
class RmwZenoh:
    """The keys of a domain. here: the domain as `Announced` has it. advice: what to do when no node is heard."""

    domain: int
    advice: ClassVar = "Start the nodes with RMW_IMPLEMENTATION=rmw_zenoh_cpp; --ros-connect names their router"

    @property
    def here(self) -> str:
        return str(self.domain)

    def topic_key(self, topic: str, of: RosType) -> str:
        """Return the key of the messages of a topic."""
        return f"{self.domain}/{topic.strip('/')}/{of.dds_name}/{of.type_hash}"

    def topic_keys_of_any_version(self, topic: str, of: RosType) -> str:
        """Return the key expression of a topic's messages of this type, whatever its fields are."""
        return f"{self.domain}/{topic.strip('/')}/{of.dds_name}/*"

    def type_hash_in(self, key: str) -> str:
        """Return the type hash of a message with this key."""
        return key.rpartition("/")[2]

    def node_token(self, session: str, node: str) -> str:
        """Return the liveliness key of a node. session: the Zenoh id. The node has the id 0 and no namespace."""
        return f"@ros2_lv/{self.domain}/{session}/0/0/NN/%/%/{node}"

    def topic_token(self, session: str, node: str, entity: int, role: str, topic: str, of: RosType) -> str:
        """Return the liveliness key of a publisher (role `MP`) or subscription (`MS`). entity: its id."""
        name = "%" + topic.strip("/").replace("/", "%")
        place = f"@ros2_lv/{self.domain}/{session}/0/{entity}/{role}/%/%/{node}"
        return f"{place}/{name}/{of.dds_name}/{of.type_hash}/{_QOS}"

    def any_publisher(self) -> str:
        """Return the key expression of the liveliness keys of all publishers of all domains."""
        return f"@ros2_lv/*/*/*/*/{_PUBLISHER}/**"

    def announced_by(self, token: str) -> Announced | None:
        """Return the publisher of a liveliness key, None if it is one of something else."""
        parts = token.split("/")
        if len(parts) != _TOKEN_PARTS or parts[5] != _PUBLISHER:
            return None
        _, domain, session, _, _, _, _, _, node, topic, dds_name, _, _ = parts
        name = dds_name.replace("::dds_::", "::").removesuffix("_").replace("::", "/")
        return Announced(domain, session, node, topic.replace("%", "/"), name)


def gid_of(token: str) -> bytes:
    """Return the identity of an entity: XXH3 of its liveliness key, the low 64 bits first, each half little-endian."""
    return xxh3_128_digest(token.encode())[::-1]

"""How zenoh-bridge-ros2dds names the topics of nodes that use DDS, and announces them.

The payload of a message is its CDR, as DDS has it. Source: liveliness_mgt.rs, ros2_utils.rs, route_publisher.rs and
route_subscriber.rs of eclipse-zenoh/zenoh-plugin-ros2dds.
"""

from dataclasses import dataclass
from typing import ClassVar

from dropanchor_service.bridges.rmw_zenoh import Announced, RmwZenoh, RosType

ANY_TYPE_HASH = ""
"""Stands for that of Humble or of Jazzy: no key tells."""
_SLASH = "§"  # stands for a slash in a liveliness key
_QOS = ":1:0:0,10"  # without a key, reliable, volatile, keep the last 10
_TOKEN_PARTS = 7


@dataclass(frozen=True)
class Ros2Dds:
    """As `RmwZenoh`. namespace: what the configuration of the bridge puts before all names, `/` for nothing."""

    namespace: str
    here: ClassVar = ""
    advice: ClassVar = (
        "Start zenoh-bridge-ros2dds in the domain of the nodes (ROS_DOMAIN_ID), with their topics allowed in its "
        "configuration; --ros-connect names where it listens"
    )

    def topic_key(self, topic: str, of: RosType) -> str:  # noqa: ARG002 - its keys name no types
        return f"{self.namespace.strip('/')}/{topic.strip('/')}".strip("/")

    topic_keys_of_any_version = topic_key

    def type_hash_in(self, key: str) -> str:  # noqa: ARG002
        return ANY_TYPE_HASH

    def node_token(self, session: str, node: str) -> str:  # noqa: ARG002 - it tells sessions apart, and not nodes
        return f"@/{session}/@ros2_lv"

    def topic_token(self, session: str, node: str, entity: int, role: str, topic: str, of: RosType) -> str:  # noqa: ARG002
        key, name = (text.replace("/", _SLASH) for text in (self.topic_key(topic, of), of.name))
        return f"@/{session}/@ros2_lv/{role}/{key}/{name}/{_QOS}"

    def any_publisher(self) -> str:
        return "@/*/@ros2_lv/MP/*/*/*"

    def announced_by(self, token: str) -> Announced | None:
        parts = token.split("/")
        if len(parts) != _TOKEN_PARTS or parts[3] != "MP":
            return None
        topic, type_name = (text.replace(_SLASH, "/") for text in parts[4:6])
        topic = topic.removeprefix(f"{self.namespace.strip('/')}/")
        return Announced(self.here, parts[1], "behind the bridge", f"/{topic}", type_name)


RosKeys = RmwZenoh | Ros2Dds

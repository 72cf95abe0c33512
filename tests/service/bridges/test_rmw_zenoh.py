"""Keys, liveliness tokens and attachments as rmw_zenoh documents them, and zenoh-bridge-ros2dds has them."""

import pytest
import zenoh

from dropanchor_service.bridges.rmw_zenoh import Announced, Attachment, RmwZenoh, RosType, attachment_from, gid_of
from dropanchor_service.bridges.ros2dds import Ros2Dds, RosKeys

HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
STRING = RosType("std_msgs/msg/String", HASH)


def test_keys_and_tokens_have_the_form_of_the_examples_in_the_design_document() -> None:
    assert RmwZenoh(0).topic_key("/chatter", STRING) == f"0/chatter/std_msgs::msg::dds_::String_/{HASH}"
    assert RmwZenoh(2).topic_key("/robot1/chatter", STRING) == f"2/robot1/chatter/std_msgs::msg::dds_::String_/{HASH}"
    assert RmwZenoh(0).node_token("aac3178e146ba6f1fc6e6a4085e77f21", "listener") == (
        "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
    )
    assert RmwZenoh(0).topic_token("8b20917502ee955ac4476e0266340d5c", "talker", 10, "MP", "chatter", STRING) == (
        "@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
        f"std_msgs::msg::dds_::String_/{HASH}/::,10:,:,:,,"
    )


@pytest.mark.parametrize(
    ("keys", "domain", "node"),
    [(RmwZenoh(7), "7", "driver"), (Ros2Dds("/"), "", "behind the bridge"), (Ros2Dds("/a"), "", "behind the bridge")],
)
def test_the_publisher_of_a_token_is_read_back(keys: RosKeys, domain: str, node: str) -> None:
    token = keys.topic_token("8b20", "driver", 10, "MP", "/imu/data", STRING)
    assert keys.announced_by(token) == Announced(domain, "8b20", node, "/imu/data", "std_msgs/msg/String")
    assert zenoh.KeyExpr(keys.any_publisher()).includes(zenoh.KeyExpr(token))
    for other in (keys.topic_token("8b20", "driver", 10, "MS", "/imu", STRING), keys.node_token("8b20", "driver"), ""):
        assert keys.announced_by(other) is None


def test_publishers_of_other_domains_are_heard_too() -> None:
    token = RmwZenoh(8).topic_token("8b20", "driver", 10, "MP", "/imu/data", STRING)
    assert zenoh.KeyExpr(RmwZenoh(7).any_publisher()).includes(zenoh.KeyExpr(token))


def test_an_attachment_has_33_bytes() -> None:
    sent = Attachment(1, 2, bytes(range(16)))
    packed = sent.packed()
    assert packed == bytes([1, *[0] * 7, 2, *[0] * 7, 16, *range(16)])
    assert attachment_from(packed) == sent
    assert attachment_from(packed[:-1]) is None
    assert attachment_from(packed[:16] + b"\x0f" + packed[17:]) is None


def test_a_gid_is_xxh3_of_the_token_with_the_low_half_first() -> None:
    """XXH3-128 of nothing is 99aa06d3014798d8 (high) 6001c324468d497f (low)."""
    assert gid_of("") == bytes.fromhex("7f498d4624c30160d8984701d306aa99")

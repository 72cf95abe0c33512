"""Messages of simulated tags as packed payloads, in the order of their delivery."""

from itertools import count
from typing import Any, NamedTuple

from dropanchor_schemas.wire import Frame, encode_packed
from dropanchor_tag_client.simulator.live import deliveries, start_poses, tag_name
from dropanchor_tag_client.simulator.sensors import preset

T0_NS = 1_760_000_000_000_000_000


class Message(NamedTuple):
    due_ns: int
    tag: str
    payload: bytes


def traffic(tags: int, duration_s: float, seed: int, step_s: float = 0.2) -> list[Message]:
    """Return the raw 9-axis samples and ranges of `tags` tags of the scenario "yard".

    Each tag numbers its own messages. The messages have boot ids from 1 and stand in the order of `due_ns`.
    """
    messages: list[Message] = []
    sequences = [count() for _ in range(tags)]
    for delivery in deliveries(tags, "yard", seed, preset("calibrated"), T0_NS, step_s):
        if delivery.due_s > duration_s:
            return messages
        frame = Frame(
            imu=delivery.imu,
            ranges=delivery.ranges,
            sequence=next(sequences[delivery.tag]),
            boot_id=delivery.tag + 1,
        )
        due_ns = T0_NS + round(delivery.due_s * 1e9)
        messages.append(Message(due_ns, tag_name(delivery.tag), encode_packed(frame)))
    return messages


def known_starts(tags: int, seed: int) -> dict[str, dict[str, Any]]:
    """Return, by tag, the settings with the true start of each tag that `traffic` makes of the same count and seed."""
    return {
        tag_name(index): {"start": {"x": pose.x, "y": pose.y, "heading_rad": pose.heading_rad}}
        for index, pose in enumerate(start_poses(tags, seed))
    }

"""What simulated tags publish, as packed payloads in the order of their delivery."""

from itertools import count
from typing import NamedTuple

from dropanchor_schemas.wire import Frame, encode_packed
from dropanchor_tag_client.simulator.live import deliveries, tag_name
from dropanchor_tag_client.simulator.sensors import preset

T0_NS = 1_760_000_000_000_000_000


class Message(NamedTuple):
    due_ns: int
    tag: str
    payload: bytes


def traffic(tags: int, duration_s: float, seed: int, step_s: float = 0.2) -> list[Message]:
    """Raw 9-axis samples and ranges of `tags` tags of the yard, each numbered by a publisher of its own."""
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

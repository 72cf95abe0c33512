"""A ROS 2 node on a Zenoh session, as other nodes see it: with rmw_zenoh, or behind a bridge to DDS."""

import time
from collections.abc import Callable
from queue import Empty, Full, Queue
from typing import NamedTuple

import zenoh

from dropanchor_service.bridges.rmw_zenoh import Announced, Attachment, RosType, attachment_from, gid_of
from dropanchor_service.bridges.ros2dds import RosKeys

_QUEUED_MESSAGES = 10_000
_MAX_PUBLISHERS = 10_000


class Received(NamedTuple):
    """A message of a subscription. t_ns: when it was sent, or received if it does not say."""

    topic: str
    cdr: bytes
    t_ns: int
    type_hash: str
    handle: "Callable[[Received], None]"


class RosNode:
    """Publishes and subscribes under one name. lost: number of messages that came faster than they were taken.

    Close the session to end the node.
    """

    def __init__(self, session: zenoh.Session, keys: RosKeys, name: str) -> None:
        self.lost = 0
        self._session = session
        self._keys = keys
        self._name = name
        self._entities = 0
        self._queue: Queue[Received] = Queue(_QUEUED_MESSAGES)
        self._kept: list[object] = [self._declare(keys.node_token(self._id, name))]
        self._announced: dict[str, Announced] = {}
        announced = session.liveliness().declare_subscriber(keys.any_publisher(), self._note_publisher, history=True)
        self._kept.append(announced)

    def publisher(self, topic: str, of: RosType) -> Callable[[bytes], None]:
        """Announce a publisher, and return the function that publishes a CDR message."""
        gid = gid_of(self._announce("MP", topic, of))
        publisher = self._session.declare_publisher(
            self._keys.topic_key(topic, of), congestion_control=zenoh.CongestionControl.DROP
        )
        sequence = 0

        def publish(cdr: bytes) -> None:
            nonlocal sequence
            sequence += 1
            publisher.put(cdr, attachment=Attachment(sequence, time.time_ns(), gid).packed())

        return publish

    def subscribe(self, topic: str, of: RosType, handle: Callable[[Received], None]) -> None:
        """Announce a subscription. `take` returns its messages with `handle`."""
        self._announce("MS", topic, of)

        def receive(sample: zenoh.Sample) -> None:  # on a thread of Zenoh: it must not block
            attached = None if sample.attachment is None else attachment_from(sample.attachment.to_bytes())
            t_ns = time.time_ns() if attached is None else attached.t_ns
            type_hash = self._keys.type_hash_in(str(sample.key_expr))
            try:
                self._queue.put_nowait(Received(topic, sample.payload.to_bytes(), t_ns, type_hash, handle))
            except Full:
                self.lost += 1

        self._kept.append(self._session.declare_subscriber(self._keys.topic_keys_of_any_version(topic, of), receive))

    def take(self, timeout_s: float) -> Received | None:
        """Return the next message, None if none comes in time."""
        try:
            return self._queue.get(timeout=timeout_s)
        except Empty:
            return None

    def publishers_of_others(self) -> list[Announced]:
        """Return the publishers that other nodes announce."""
        return [one for one in list(self._announced.values()) if one.session != self._id]

    def _note_publisher(self, sample: zenoh.Sample) -> None:  # on a thread of Zenoh
        token = str(sample.key_expr)
        announced = self._keys.announced_by(token)
        if sample.kind == zenoh.SampleKind.DELETE:
            self._announced.pop(token, None)
        elif announced is not None and len(self._announced) < _MAX_PUBLISHERS:
            self._announced[token] = announced

    @property
    def _id(self) -> str:
        return str(self._session.info.zid())

    def _announce(self, role: str, topic: str, of: RosType) -> str:
        self._entities += 1
        token = self._keys.topic_token(self._id, self._name, self._entities, role, topic, of)
        self._kept.append(self._declare(token))
        return token

    def _declare(self, token: str) -> zenoh.LivelinessToken:
        return self._session.liveliness().declare_token(token)

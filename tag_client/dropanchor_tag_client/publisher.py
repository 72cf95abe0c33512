"""Zenoh publishers for payloads: one with a cache that covers outages, and a plain one."""

from typing import Any, Protocol

import zenoh
import zenoh.ext

HEARTBEAT_S = 0.5


class Publisher(Protocol):
    def put(self, payload: bytes) -> Any: ...

    def undeclare(self) -> Any: ...


def declare_publisher(
    session: zenoh.Session, key: str, encoding: str, *, cache_messages: int, wait_when_congested: bool
) -> Publisher:
    """Return a publisher that keeps its last messages, so that a subscriber can fetch the ones it missed.

    cache_messages: how many; with 0 nothing is declared, so that a session holds thousands of tags.
    """
    if cache_messages == 0:
        return PlainPublisher(session, key, encoding, wait_when_congested=wait_when_congested)
    return zenoh.ext.declare_advanced_publisher(
        session,
        key,
        encoding=encoding,
        congestion_control=_congestion_control(wait_when_congested),
        cache=zenoh.ext.CacheConfig(max_samples=cache_messages),
        sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=HEARTBEAT_S, sporadic_heartbeat=None),
        publisher_detection=True,
    )


class PlainPublisher:
    """Put messages without declaring a publisher. Nothing is recovered, but a session holds thousands of tags."""

    def __init__(self, session: zenoh.Session, key: str, encoding: str, *, wait_when_congested: bool) -> None:
        self._session = session
        self._key = key
        self._encoding = zenoh.Encoding(encoding)
        self._congestion_control = _congestion_control(wait_when_congested)

    def put(self, payload: bytes) -> None:
        self._session.put(self._key, payload, encoding=self._encoding, congestion_control=self._congestion_control)

    def undeclare(self) -> None:
        """Do nothing: this publisher declares nothing."""


def _congestion_control(wait_when_congested: bool) -> zenoh.CongestionControl:
    return zenoh.CongestionControl.BLOCK if wait_when_congested else zenoh.CongestionControl.DROP

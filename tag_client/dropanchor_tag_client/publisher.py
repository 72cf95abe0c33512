"""What carries payloads to the router: with a cache that fills the gaps of an outage, or plainly."""

from typing import Any, Protocol

import zenoh
import zenoh.ext

HEARTBEAT_S = 0.5


class Publisher(Protocol):
    def put(self, payload: bytes) -> Any: ...

    def undeclare(self) -> Any: ...


def recoverable_publisher(
    session: zenoh.Session, key: str, encoding: str, *, cache_messages: int, wait_when_congested: bool
) -> Publisher:
    """A publisher that keeps its last messages, so that a subscriber can ask for those it missed."""
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
    """Puts without declaring a publisher: nothing is recovered, and thousands of tags fit into one session."""

    def __init__(self, session: zenoh.Session, key: str, encoding: str, *, wait_when_congested: bool) -> None:
        self._session = session
        self._key = key
        self._encoding = zenoh.Encoding(encoding)
        self._congestion_control = _congestion_control(wait_when_congested)

    def put(self, payload: bytes) -> None:
        self._session.put(self._key, payload, encoding=self._encoding, congestion_control=self._congestion_control)

    def undeclare(self) -> None:
        """Nothing was declared."""


def _congestion_control(wait_when_congested: bool) -> zenoh.CongestionControl:
    return zenoh.CongestionControl.BLOCK if wait_when_congested else zenoh.CongestionControl.DROP

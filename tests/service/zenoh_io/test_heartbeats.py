"""Zenoh recovers the last messages of a publisher from its heartbeats, but not on keys with a chunk such as `@v1`."""

from collections.abc import Callable

import zenoh

from support.zenoh_router import connected_session, dropping_router, wait_until

BEATS = 5  # that a subscriber gets before the test concludes that it ignores them


def received_after_a_loss(key: str, is_enough: Callable[[list[bytes], int], bool]) -> list[bytes]:
    """Lose all messages but the first, and return what a subscriber has got when messages and heartbeats are enough."""
    received: list[bytes] = []
    beats: list[str] = []
    with dropping_router(key) as endpoint, connected_session(endpoint) as here, connected_session(endpoint) as there:
        zenoh.ext.declare_advanced_subscriber(
            there,
            key,
            lambda message: received.append(bytes(message.payload)),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
        )
        there.declare_subscriber(f"{key}/@adv/pub/**", lambda beat: beats.append(str(beat.key_expr)))
        publisher = zenoh.ext.declare_advanced_publisher(
            here,
            key,
            cache=zenoh.ext.CacheConfig(max_samples=10),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=0.2, sporadic_heartbeat=None),
            publisher_detection=True,
        )
        probe = here.declare_publisher(key)  # an advanced publisher does not tell whether anybody subscribes
        wait_until(lambda: getattr(probe.matching_status, "matching", probe.matching_status))
        for payload in (b"1", b"2", b"3"):
            publisher.put(payload)
        wait_until(lambda: is_enough(received, len(beats)))
    return received


def test_heartbeats_recover_the_last_messages() -> None:
    assert received_after_a_loss("site/v1/tag", lambda received, _: len(received) == 3) == [b"1", b"2", b"3"]


def test_heartbeats_on_a_key_with_a_verbatim_chunk_recover_nothing() -> None:
    """If this fails, Zenoh has changed: then `ZenohCaches.ask_if_silent` may not be needed any more."""
    received = received_after_a_loss("site/@v1/tag", lambda _, beats: beats >= BEATS)
    assert received == [b"1"]

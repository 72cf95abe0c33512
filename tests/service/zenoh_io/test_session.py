"""The router of the service must deliver all messages of publishers without recovery."""

from threading import Lock, Thread

import zenoh.ext

from dropanchor_schemas.keys import all_tags, samples_key
from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.zenoh_io.session import open_session
from support.zenoh_router import connected_session, free_endpoint, wait_until

SESSIONS, MESSAGES = 16, 500


def test_a_subscriber_with_recovery_receives_every_message_of_many_plain_publishers() -> None:
    endpoint = free_endpoint()
    received, lock = [0], Lock()

    def count(_: zenoh.Sample) -> None:
        with lock:
            received[0] += 1

    recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
    with open_session(ZenohSettings(listen=(endpoint,))), connected_session(endpoint) as listening:
        zenoh.ext.declare_advanced_subscriber(
            listening, all_tags("default", "samples"), zenoh.handlers.Callback(count, indirect=False), recovery=recovery
        )
        threads = [Thread(target=publish, args=(endpoint, f"tag-{number}")) for number in range(SESSIONS)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        wait_until(lambda: received[0] == SESSIONS * MESSAGES)


def publish(endpoint: str, tag: str) -> None:
    with connected_session(endpoint) as session:
        publisher = session.declare_publisher(
            samples_key("default", tag), congestion_control=zenoh.CongestionControl.BLOCK
        )
        wait_until(lambda: getattr(publisher.matching_status, "matching", publisher.matching_status))
        for number in range(MESSAGES):
            publisher.put(number.to_bytes(400, "little"))

"""A router that is killed and restarted costs no sample of a tag whose cache covers the outage."""

import time
from contextlib import suppress

from dropanchor_tag_client import TagClient
from support.service import running_service
from support.zenoh_router import free_endpoint, start_router_process, wait_until

PUBLISHED = 400


def test_no_sample_is_lost_or_duplicated_while_the_router_is_down() -> None:
    endpoint = free_endpoint()
    router = start_router_process(endpoint)
    try:
        with running_service("--zenoh-connect", endpoint) as service, TagClient("a", connect=endpoint) as client:
            for number in range(PUBLISHED):
                client.publish_range(7, 10.0)
                if number == 100:
                    router.kill()
                    router.communicate()
                if number == 200:
                    router = start_router_process(endpoint)
                time.sleep(0.01)
            client.flush()
            with suppress(AssertionError):  # the next assertion names what is missing
                wait_until(lambda: service.get("/api/v1/tags/a")["samples"] == {"range": PUBLISHED})
            assert service.get("/api/v1/tags/a")["samples"] == {"range": PUBLISHED}
            assert service.metric("dropanchor_missed_messages_total") == 0
            wait_until(lambda: service.get("/api/v1/tags/a")["online"])
    finally:
        router.kill()
        router.communicate()

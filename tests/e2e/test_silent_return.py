"""What a tag published and the service did not receive is used, although the tag is silent then."""

from dropanchor_schemas import keys
from dropanchor_tag_client import TagClient
from support.relay import running_relay
from support.service import Running, running_service
from support.zenoh_router import dropping_router, free_endpoint, start_router_process, wait_until


def used(service: Running) -> int:
    """Return how many ranges of the tag reached its estimator."""
    tags = {tag["tag"]: tag for tag in service.get("/api/v1/tags")["tags"]}
    return int(tags["a"]["samples"].get("range", 0)) if "a" in tags else 0


def is_online(service: Running) -> bool:
    return any(tag["online"] for tag in service.get("/api/v1/tags")["tags"])


def publish(tag: TagClient, count: int) -> None:
    for _ in range(count):
        tag.publish_range(7, 10.0)


def test_after_a_cut_link() -> None:
    with running_service() as service, running_relay(int(service.zenoh.rpartition(":")[2])) as relay:
        with TagClient("a", connect=f"tcp/127.0.0.1:{relay.port}", batch_samples=1) as tag:
            publish(tag, 20)
            wait_until(lambda: used(service) == 20)
            relay.silent.set()
            publish(tag, 40)
            wait_until(lambda: not is_online(service))
            relay.silent.clear()
            wait_until(lambda: used(service) == 60)
        assert service.metric("dropanchor_missed_messages_total") == 0


def test_after_a_router_that_was_killed() -> None:
    endpoint = free_endpoint()
    router = start_router_process(endpoint)
    try:
        with (
            running_service("--zenoh-connect", endpoint) as service,
            TagClient("a", connect=endpoint, batch_samples=1) as tag,
        ):
            publish(tag, 20)
            wait_until(lambda: used(service) == 20)
            router.kill()
            router.communicate()
            publish(tag, 40)
            router = start_router_process(endpoint)
            wait_until(lambda: used(service) == 60)
    finally:
        router.kill()
        router.communicate()


def test_after_messages_that_the_router_dropped() -> None:
    with (
        dropping_router(keys.samples_key("default", "a")) as endpoint,
        running_service("--zenoh-connect", endpoint) as service,
        TagClient("a", connect=endpoint, batch_samples=1) as tag,
    ):
        publish(tag, 20)
        wait_until(lambda: used(service) == 20)

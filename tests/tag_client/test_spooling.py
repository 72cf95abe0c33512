"""Messages of a long outage go through the disk, and arrive in their order with their numbers."""

import os
import signal
import time
from pathlib import Path

import pytest

from dropanchor_tag_client import TagClient
from support.commands import python, start_python
from support.frozen_link import frozen_link
from support.listening import ReceivedFrames, listening_with_recovery
from support.zenoh_router import free_endpoint, router_process, wait_until

CACHE = 60  # messages, which the outages below exceed

PUBLISH = """
import itertools, sys, time
from dropanchor_tag_client import TagClient
with TagClient("a", connect=sys.argv[1], spool=sys.argv[2], cache_messages=int(sys.argv[4]), batch_samples=1) as tag:
    print(tag.boot_id, flush=True)
    for i in itertools.count():
        tag.publish_range(1, float(i))
        time.sleep(float(sys.argv[3]))
"""


@pytest.fixture
def endpoint() -> str:
    return free_endpoint()


def client(endpoint: str, folder: Path) -> TagClient:
    return TagClient("a", connect=endpoint, spool=folder, cache_messages=CACHE, batch_samples=1)


def publish(tag: TagClient, numbers: range) -> None:
    for i in numbers:
        tag.publish_range(1, float(i))


def numbers_of(heard: ReceivedFrames, boot_id: int) -> list[int]:
    """Return the sequences of a publisher as they arrived, without those that arrived before."""
    found = [frame.sequence or 0 for frame in heard.frames if frame.boot_id == boot_id]
    return list(dict.fromkeys(found))


def test_an_outage_longer_than_the_cache_loses_nothing_and_keeps_order_and_numbers(
    endpoint: str, tmp_path: Path
) -> None:
    with client(endpoint, tmp_path) as tag:
        with router_process(endpoint), listening_with_recovery(endpoint) as heard:
            publish(tag, range(100))
            wait_until(lambda: len(heard.frames) >= 100)
        publish(tag, range(100, 1000))
        with router_process(endpoint), listening_with_recovery(endpoint) as later:
            publish(tag, range(1000, 1100))
            wait_until(lambda: later.ranges() and later.ranges()[-1] == 1099.0)
            wait_until(lambda: tag.spool_counts is not None and tag.spool_counts.waiting_bytes == 0)
            publish(tag, range(1100, 1200))
            wait_until(lambda: later.ranges()[-1] == 1199.0)
    assert numbers_of(heard, tag.boot_id)[:100] == list(range(100))
    assert [number for number in numbers_of(later, tag.boot_id) if number >= 100] == list(range(100, 1200))


def test_a_tag_starts_without_a_router_and_sends_what_it_measured_meanwhile(endpoint: str, tmp_path: Path) -> None:
    with client(endpoint, tmp_path) as tag:
        publish(tag, range(500))
        with router_process(endpoint), listening_with_recovery(endpoint) as heard:
            wait_until(lambda: len(heard.frames) >= 500)
    assert heard.ranges() == [float(i) for i in range(500)]
    assert numbers_of(heard, tag.boot_id) == list(range(500))


def test_what_a_closed_tag_could_not_send_is_sent_by_the_next_one(endpoint: str, tmp_path: Path) -> None:
    with client(endpoint, tmp_path) as first:
        publish(first, range(300))
    with (
        router_process(endpoint),
        listening_with_recovery(endpoint) as heard,
        client(endpoint, tmp_path) as second,
    ):
        publish(second, range(300, 310))
        wait_until(lambda: len(heard.frames) >= 310)
    assert heard.ranges() == [float(i) for i in range(310)]
    assert numbers_of(heard, first.boot_id) == list(range(300))
    assert numbers_of(heard, second.boot_id) == list(range(10))


def test_a_tag_killed_in_an_outage_loses_nothing_that_was_on_disk(endpoint: str, tmp_path: Path) -> None:
    process = start_python("-c", PUBLISH, endpoint, str(tmp_path), "0.005", "60")
    try:
        assert process.stdout is not None
        killed_id = int(process.stdout.readline())
        wait_until(lambda: sum(path.stat().st_size for path in tmp_path.rglob("*.spool")) > 20_000)
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    on_disk = sum(path.stat().st_size for path in tmp_path.rglob("*.spool"))
    with open(max(tmp_path.rglob("*.spool")), "ab") as file:
        file.write(os.urandom(40))  # as if the power had been cut within a record
    with (
        router_process(endpoint),
        listening_with_recovery(endpoint) as heard,
        client(endpoint, tmp_path) as tag,
    ):
        publish(tag, range(5))
        wait_until(lambda: numbers_of(heard, tag.boot_id) == list(range(5)))
        assert tag.spool_counts is not None
        assert tag.spool_counts.damaged == 1
    of_killed = numbers_of(heard, killed_id)
    assert of_killed == list(range(on_disk // (12 + 32 + 16)))
    assert [frame.boot_id for frame in heard.frames] == [killed_id] * len(of_killed) + [tag.boot_id] * 5


def test_what_was_sent_into_a_cut_link_is_sent_again_even_by_the_next_process(endpoint: str, tmp_path: Path) -> None:
    with router_process(endpoint), listening_with_recovery(endpoint) as heard, frozen_link(endpoint) as link:
        process = start_python("-c", PUBLISH, link.endpoint, str(tmp_path), "0.02", "60")
        try:
            assert process.stdout is not None
            killed_id = int(process.stdout.readline())
            wait_until(lambda: len(heard.frames) > 50 and not list(tmp_path.rglob("*.spool")))
            link.frozen.set()
            wait_until(lambda: list(tmp_path.rglob("*.spool")))  # the tag has noticed, after the lease
            time.sleep(0.5)
        finally:
            process.kill()
            process.communicate()
        with client(endpoint, tmp_path) as tag:
            publish(tag, range(1))
            wait_until(lambda: numbers_of(heard, tag.boot_id) == [0])
    arrived = numbers_of(heard, killed_id)
    assert arrived == list(range(len(arrived)))
    assert len(arrived) > 150


def test_a_fast_tag_leaves_the_spool_once_it_is_connected(endpoint: str, tmp_path: Path) -> None:
    with router_process(endpoint), listening_with_recovery(endpoint) as heard:
        process = start_python("-c", PUBLISH, endpoint, str(tmp_path), "0.002", "600")
        try:
            wait_until(lambda: len(heard.frames) > 1000 and not list(tmp_path.rglob("*.spool")))
        finally:
            process.kill()
            process.communicate()
    arrived = [frame.sequence for frame in heard.frames]
    assert arrived == list(range(len(arrived)))


def test_the_command_publish_spools_and_sends_at_its_next_start(endpoint: str, tmp_path: Path) -> None:
    command = ("-m", "dropanchor_tag_client", "publish", "--tag", "a", "--connect", endpoint, "--spool", str(tmp_path))
    first = python(*command, text_input='{"anchor": 1, "range_m": 1.0}\n')
    assert first.returncode == 0, first.stderr
    with router_process(endpoint), listening_with_recovery(endpoint) as heard:
        second = python(*command, "--encoding", "json", text_input='{"anchor": 1, "range_m": 2.0}\n')
        assert second.returncode == 0, second.stderr
        wait_until(lambda: len(heard.frames) == 2)
    assert heard.ranges() == [1.0, 2.0]


def test_a_connected_tag_does_not_write_to_the_disk(endpoint: str, tmp_path: Path) -> None:
    with router_process(endpoint), listening_with_recovery(endpoint) as heard, client(endpoint, tmp_path) as tag:
        publish(tag, range(1))
        wait_until(lambda: heard.frames)
        wait_until(lambda: tag.spool_counts is not None and tag.spool_counts.waiting_bytes == 0)
        time.sleep(0.5)
        before = tag.spool_counts  # the first message went through the spool if it came before the connection
        publish(tag, range(1, 1000))
        assert tag.spool_counts == before
        assert not list(tmp_path.rglob("*.spool"))


@pytest.mark.parametrize("options", [{"clock": "boot"}, {"cache_messages": 0}, {"connect_timeout_s": 1.0}])
def test_a_spool_says_what_it_needs(options: dict[str, object], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a spool needs"):
        TagClient("a", spool=tmp_path, **options)  # type: ignore[arg-type]

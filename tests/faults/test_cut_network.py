"""No sample of a tag on another host is lost, although its link is cut and loses packets."""

import subprocess
import sys
import time
from contextlib import ExitStack, suppress

from support.commands import environment
from support.lossy_link import LossyLink, lossy_link
from support.service import Running, running_service
from support.zenoh_router import free_port, wait_until

HZ = 20
CUT_S = 8.0
LOSSY_S = 5.0
LOSS = 0.2

# Publishes one sample per message until a line arrives on stdin. Then it stays, so that its cache can be read.
TAG = f"""
import sys, threading, time
from dropanchor_tag_client import TagClient
stop = threading.Event()
threading.Thread(target=lambda: (sys.stdin.readline(), stop.set()), daemon=True).start()
with TagClient("far", connect=sys.argv[1], batch_samples=1) as tag:
    while not stop.wait(1 / {HZ}):
        tag.publish_range(7, 10.0 + 0.001 * tag.sent.samples)
    print(tag.sent.samples, flush=True)
    sys.stdin.readline()
"""


def used(service: Running) -> int:
    """Return how many samples of the tag reached its estimator."""
    found = [tag for tag in service.get("/api/v1/tags")["tags"] if tag["tag"] == "far"]
    return int(found[0]["samples"].get("range", 0)) if found else 0


def state_of(service: Running, link: LossyLink) -> str:
    """Return what a failure needs to be understood: the tag as the service knows it, the connections, and the link."""
    tags = service.get("/api/v1/tags")["tags"]
    connections = subprocess.run(["ss", "-tino", "dst", link.there], capture_output=True, text=True, check=False).stdout
    return f"{tags}\n{connections}\n{link.carried} packets carried, {link.lost} lost"


def stop_publishing(tag: subprocess.Popen[str]) -> None:
    assert tag.stdin is not None
    tag.stdin.write("\n")
    tag.stdin.flush()


def disturb(service: Running, link: LossyLink) -> None:
    """Cut the link for CUT_S, then lose a share LOSS of its packets for LOSSY_S."""
    link.loss = 1.0
    before = used(service)
    time.sleep(CUT_S)
    assert used(service) <= before + HZ, "the link was not cut"
    link.loss = LOSS
    time.sleep(LOSSY_S)


def test_a_cut_link_and_a_link_that_drops_every_fifth_packet_lose_no_sample() -> None:
    with ExitStack() as opened:
        link = opened.enter_context(lossy_link())
        endpoint = f"tcp/{link.here}:{free_port()}"
        service = opened.enter_context(running_service("--insecure", "--zenoh-listen", endpoint))
        words = link.elsewhere(sys.executable, "-c", TAG, endpoint)
        with subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment()
        ) as tag:
            try:
                wait_until(lambda: used(service) > HZ)
                disturb(service, link)
                stop_publishing(tag)
                assert tag.stdout is not None
                sent = int(tag.stdout.readline())
                # TCP doubles its pauses while packets are lost, so the last samples might take minutes otherwise.
                link.loss = 0.0
                with suppress(AssertionError):  # the next assertion says what is missing
                    wait_until(lambda: used(service) >= sent)
                assert used(service) == sent, state_of(service, link)
                assert service.metric("dropanchor_missed_messages_total") == 0
                assert link.lost > 20
                print(f"{sent} samples sent, {sent - used(service)} lost; {link.lost} packets lost")  # noqa: T201
            finally:
                tag.kill()

"""Thousands of tags enter a zone at once: people get few mails, systems get every event, and memory stays bounded."""

import resource
import time
from collections.abc import Sequence
from pathlib import Path

from dropanchor_schemas.destinations import EmailDestination
from dropanchor_service.delivery.mail import MAX_EVENTS
from dropanchor_service.settings.events import EmailSettings
from support.delivery import DeliveryBench
from support.mail_server import MailServer, running_mail_server
from support.receiver import Receiver, running_receiver
from support.zenoh_router import wait_until

TAGS = 10_000
MAX_GROWTH_MIB = 200  # of this process, which also holds the receivers and everything that they got


def peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def subjects_in(server: MailServer) -> list[str]:
    lines = (line for mail in server.mails for line in mail.get_content().splitlines())
    return [line.split()[0] for line in lines if line.endswith("entered Loading dock.")]


def entering(tags: Sequence[str], bench: DeliveryBench) -> None:
    for begin in range(0, len(tags), TAGS // 4):  # a storm does not end within one turn of the watcher
        bench.happen(*tags[begin : begin + TAGS // 4])


def test_nothing_of_a_storm_is_lost_and_mails_become_digests(tmp_path: Path) -> None:
    check_storm(2000, tmp_path)


def check_storm(size: int, tmp_path: Path) -> str:
    """Deliver the events of that many tags by mail and to a webhook. Return how long it took, and the memory."""
    tags = [f"tag-{number}" for number in range(size)]
    server, receiver = MailServer(), Receiver()
    email = EmailSettings(server="127.0.0.1", port=server.port, tls="none")
    bench = DeliveryBench(email=email, folder=tmp_path)
    with running_mail_server(server), running_receiver(receiver):
        bench.put(EmailDestination(type="email", id="shift", to=["shift@example.com"], digest_s=3.0))
        bench.hook(receiver)
        before_mib, begun_s = peak_mib(), time.monotonic()
        entering(tags, bench)
        with bench.thread:
            wait_until(lambda: bench.counts("shift") == (0, 0))
            mailed_s = time.monotonic() - begun_s
            wait_until(lambda: bench.counts() == (0, 0))
        posted_s = time.monotonic() - begun_s
    growth_mib = peak_mib() - before_mib
    assert subjects_in(server) == tags
    assert len(server.mails) == -(-size // MAX_EVENTS)
    assert set(receiver.subjects()) == set(tags)
    assert len({event["id"] for event in receiver.accepted}) == size
    assert growth_mib < MAX_GROWTH_MIB
    bench.store.database.close()
    return f"mailed in {mailed_s:.1f} s, posted in {posted_s:.1f} s, peak memory +{growth_mib:.0f} MiB"


def test_a_storm_while_a_mail_is_on_its_way_makes_one_more_mail() -> None:
    server = MailServer()
    bench = DeliveryBench(email=EmailSettings(server="127.0.0.1", port=server.port, tls="none"))
    bench.put(
        EmailDestination(type="email", id="shift", to=["shift@example.com"], digest_s=15.0)
    )  # longer than it takes them to enter
    with running_mail_server(server), bench.thread:
        bench.happen("first")
        wait_until(lambda: len(server.mails) == 1)
        entering([f"tag-{number}" for number in range(TAGS)], bench)
        wait_until(lambda: bench.counts("shift") == (0, 0))
    assert [mail["Subject"] for mail in server.mails] == [
        "[yard] first entered Loading dock",
        "[yard] tag-0 entered Loading dock, and 9,999 more events",
    ]

"""A receiver that refuses for a while loses nothing: refusals take minutes, and a dead letter goes back once."""

import asyncio
import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import pytest

from dropanchor_service.delivery import queue
from dropanchor_service.delivery.channel import Outcome, Portion, Verdict
from dropanchor_service.delivery.queue import MAX_REFUSALS, Counts, Patience, Queue
from support.delivery import DeliveryBench
from support.receiver import Receiver, running_receiver
from support.zenoh_router import wait_until

MINUTE_NS, HOUR_NS = 60 * 10**9, 3600 * 10**9
REFUSED, UNAVAILABLE = Outcome(Verdict.REFUSED, "no such event"), Outcome(Verdict.UNAVAILABLE, "not there")
ACCEPTED = Outcome(Verdict.ACCEPTED, "")


@dataclass
class Answering:
    """A receiver that gives the same answer to everything."""

    outcome: Outcome
    bodies: list[bytes] = field(default_factory=list)
    portion: ClassVar[Portion] = Portion(32)

    async def send(self, events: Sequence[bytes]) -> Sequence[Outcome]:
        self.bodies += events
        return [self.outcome] * len(events)


@dataclass
class Patiently:
    """A queue whose time passes without waiting."""

    bench: DeliveryBench = field(default_factory=DeliveryBench)
    ahead_ns: int = 0

    def __post_init__(self) -> None:
        patience = Patience(retry_s=60.0, give_up_ns=24 * HOUR_NS)
        self.queue = Queue("mes", self.bench.deliveries, patience, Counts(), lambda: time.time_ns() + self.ahead_ns)

    def tries(self, channel: Answering) -> float:
        """Try until nothing is left to try. Return the pauses that this took, s."""
        paused_s = 0.0
        while True:
            if not asyncio.run(self.queue.run_once(channel)):
                if not self.queue.waiting:
                    return paused_s
                paused_s += max(max(self.queue.waiting.values()) - time.monotonic(), 0.0)
                self.queue.waiting = dict.fromkeys(self.queue.waiting, 0.0)


@pytest.fixture
def patiently() -> Patiently:
    place = Patiently()
    place.bench.hook(Receiver(port=1))
    return place


def test_five_refusals_take_longer_than_a_receiver_that_is_replaced_for_a_minute(patiently: Patiently) -> None:
    patiently.bench.happen("a")
    refusing = Answering(REFUSED)
    assert 90 < patiently.tries(refusing) < 300
    assert len(refusing.bodies) == MAX_REFUSALS
    assert patiently.bench.counts() == (0, 1)


def test_a_dead_letter_goes_back_into_the_queue_once_after_an_hour(patiently: Patiently) -> None:
    patiently.bench.happen("a")
    patiently.tries(Answering(REFUSED))
    accepting = Answering(ACCEPTED)
    patiently.ahead_ns = 59 * MINUTE_NS
    patiently.tries(accepting)
    assert accepting.bodies == []
    patiently.ahead_ns = 61 * MINUTE_NS
    patiently.tries(accepting)
    assert len(accepting.bodies) == 1
    assert patiently.bench.counts() == (0, 0)


def test_a_letter_that_is_refused_again_stays_dead(patiently: Patiently) -> None:
    patiently.bench.happen("a")
    refusing = Answering(REFUSED)
    for hours in range(4):
        patiently.ahead_ns = hours * (HOUR_NS + MINUTE_NS)
        patiently.tries(refusing)
    assert len(refusing.bodies) == 2 * MAX_REFUSALS
    assert patiently.bench.counts() == (0, 1)


def test_an_event_that_was_given_up_for_its_age_gets_its_second_chance_too(patiently: Patiently) -> None:
    patiently.bench.happen("a")
    patiently.ahead_ns = 25 * HOUR_NS
    patiently.tries(Answering(UNAVAILABLE))
    assert patiently.bench.counts() == (0, 1)
    patiently.ahead_ns += 61 * MINUTE_NS
    accepting = Answering(ACCEPTED)
    patiently.tries(accepting)
    assert len(accepting.bodies) == 1


def test_a_person_can_send_an_old_dead_letter_again(patiently: Patiently) -> None:
    place = patiently
    place.bench.happen("a")
    place.ahead_ns = 25 * HOUR_NS
    place.tries(Answering(UNAVAILABLE))
    assert place.bench.deliveries.retry("mes", time.time_ns() + place.ahead_ns) == 1
    accepting = Answering(ACCEPTED)
    place.tries(accepting)
    assert len(accepting.bodies) == 1


def test_many_refused_events_of_one_tag_hold_up_no_other_tag(
    patiently: Patiently, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(queue, "WINDOW", 8)
    patiently.bench.happen(*itertools.repeat("bad", 20), "good")
    asyncio.run(patiently.queue.run_once(Answering(REFUSED)))
    accepting = Answering(ACCEPTED)
    asyncio.run(patiently.queue.run_once(accepting))
    assert [b'"subject":"good"' in body for body in accepting.bodies] == [True]


def test_the_delivery_wakes_up_for_the_second_chance() -> None:
    bench, receiver = DeliveryBench(second_chance_s=1.0), Receiver(status=404)
    with running_receiver(receiver):
        bench.hook(receiver)
        with bench.thread:
            bench.happen("a")
            wait_until(lambda: bench.counts() == (0, 1))
            receiver.status = 200
            wait_until(lambda: bench.counts() == (0, 0))
    assert len(receiver.accepted) == 1

"""Deliver the queue of one destination: in order per tag, with back-off."""

import asyncio
import random
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from dropanchor_service.delivery.channel import Channel, Outcome, Verdict
from dropanchor_service.events.deliveries import Deliveries, Delivery

WINDOW = 1024  # oldest events of a queue that are searched for one of each tag
MAX_REFUSALS = 5
FIRST_RETRY_S = 0.5
FIRST_REFUSED_S = 15.0  # so that five refusals take longer than a receiver that is replaced answers nonsense
SECOND_CHANCE_NS = 3600 * 10**9
REREAD_S = 1.0  # after a failed read or write


@dataclass(frozen=True)
class Patience:
    """How long a queue waits.

    retry_s: the longest time between two attempts. give_up_ns: the age of a dead letter. second_chance_ns: how long a
    dead letter rests before it goes back into the queue, once.
    """

    retry_s: float
    give_up_ns: int
    second_chance_ns: int = SECOND_CHANCE_NS


@dataclass
class Counts:
    """What happened to events since the start."""

    delivered: int = 0
    failed_attempts: int = 0
    dead: int = 0


@dataclass
class Queue:
    """The queue of one destination. One event loop owns it. news: set when it may hold more than before."""

    destination: str
    deliveries: Deliveries
    patience: Patience
    counts: Counts
    now_ns: Callable[[], int]
    failures: int = 0
    due_s: float = 0.0
    problem: str | None = None
    waiting: dict[str, float] = field(default_factory=dict)  # tags whose event was refused → when it is tried again
    next_chance_ns: int | None = None  # when the next dead letter goes back into the queue
    news: asyncio.Event = field(default_factory=asyncio.Event)

    async def run_once(self, channel: Channel) -> bool:
        """Send the oldest events that may leave together. Return whether there were any.

        While the receiver is not available, a single portion or event is tried. Raises sqlite3.Error.
        """
        now_s = time.monotonic()
        if now_s < self.due_s or not self.deliveries.may_wait:
            return False
        self._give_second_chance()
        self.waiting = {tag: due_s for tag, due_s in self.waiting.items() if due_s > now_s}
        batch = self._batch(channel)
        if not batch:
            return False
        if min(entry.since_ns for entry in batch) < self.now_ns() - self.patience.give_up_ns:
            self._bury_old()
            return True
        self._note(batch, await channel.send([entry.body for entry in batch]), channel.portion.pause_s)
        return True

    async def rest(self) -> None:
        """Wait after a run that found nothing to send: for news, or until a pause is over."""
        self.news.clear()
        now_s = time.monotonic()
        pauses = [self.due_s] if self.due_s > now_s else [*self.waiting.values(), *self._next_chance_s(now_s)]
        with suppress(TimeoutError):
            async with asyncio.timeout(max(min(pauses) - now_s, 0.0) if pauses else None):
                await self.news.wait()

    def _batch(self, channel: Channel) -> list[Delivery]:
        size, is_mixed, _ = channel.portion
        if is_mixed:
            return self.deliveries.oldest(self.destination, size, self.waiting)
        return self.deliveries.heads(self.destination, 1 if self.failures else size, WINDOW, self.waiting)

    def _note(self, batch: list[Delivery], outcomes: Sequence[Outcome], pause_s: float) -> None:
        """Record the outcomes before anything else is sent."""
        by_verdict: dict[Verdict, list[tuple[Delivery, Outcome]]] = {verdict: [] for verdict in Verdict}
        for entry, outcome in zip(batch, outcomes, strict=True):
            by_verdict[outcome.verdict].append((entry, outcome))
        accepted, refused, unavailable = (by_verdict[verdict] for verdict in Verdict)
        if accepted:
            self.deliveries.remove(self.destination, [entry.sequence for entry, _ in accepted])
            self.counts.delivered += len(accepted)
            self.failures, self.problem = 0, accepted[0][1].warning
            self.due_s = time.monotonic() + pause_s
        if refused:
            self._on_refusal(refused)
        self.counts.failed_attempts += len(unavailable) + len(refused)
        if unavailable:
            self.problem = unavailable[0][1].detail
            self.due_s = time.monotonic() + back_off_s(FIRST_RETRY_S, self.failures, self.patience.retry_s)
            self.failures += 1

    def _on_refusal(self, refused: list[tuple[Delivery, Outcome]]) -> None:
        self.problem, self.failures = refused[0][1].detail, 0
        dead = [entry.sequence for entry, _ in refused if entry.refusals + 1 >= MAX_REFUSALS]
        again = [entry for entry, _ in refused if entry.refusals + 1 < MAX_REFUSALS]
        self._bury(dead, self.problem)
        self.deliveries.refuse(self.destination, [entry.sequence for entry in again])
        now_s = time.monotonic()
        self.waiting |= {
            entry.tag: now_s + back_off_s(FIRST_REFUSED_S, entry.refusals, self.patience.retry_s) for entry in again
        }

    def _next_chance_s(self, now_s: float) -> list[float]:
        chance_ns = self.next_chance_ns
        return [] if chance_ns is None else [now_s + (chance_ns - self.now_ns()) * 1e-9]

    def _bury(self, sequences: Sequence[int], reason: str) -> None:
        self.deliveries.bury(self.destination, sequences, reason, self.now_ns() + self.patience.second_chance_ns)
        self.counts.dead += len(sequences)

    def _give_second_chance(self) -> None:
        self.next_chance_ns = self.deliveries.next_chance(self.destination)
        if self.next_chance_ns is not None and self.next_chance_ns <= self.now_ns():
            self.deliveries.give_second_chance(self.destination, self.now_ns())
            self.next_chance_ns = self.deliveries.next_chance(self.destination)

    def _bury_old(self) -> None:
        expired = self.deliveries.expired(self.destination, self.now_ns() - self.patience.give_up_ns)
        reason = f"given up after {self.patience.give_up_ns / 3.6e12:g} hours: {self.problem}"
        self._bury(expired, reason)


def back_off_s(first_s: float, failures: int, longest_s: float) -> float:
    """Return the time to the next attempt, s. It doubles, and varies so that receivers are not hit in step."""
    wait_s = min(first_s * 2.0 ** min(failures, 20), longest_s)
    return wait_s * random.SystemRandom().uniform(0.75, 1.0)  # has no state that other threads share

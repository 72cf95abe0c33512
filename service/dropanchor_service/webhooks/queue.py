"""Deliver the queue of one webhook: in order per tag, with back-off."""

import asyncio
import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import httpx

from dropanchor_schemas.webhooks import Webhook
from dropanchor_service.events.deliveries import Deliveries, Delivery
from dropanchor_service.webhooks.sender import Outcome, Sender, Verdict

AT_ONCE = 32  # requests, each about another tag
WINDOW = 1024  # oldest events of a queue that are looked at
MAX_REFUSALS = 5
FIRST_RETRY_S = 0.5


@dataclass(frozen=True)
class Patience:
    """How long a queue waits. retry_s: the longest time between two attempts. give_up_ns: the age of a dead letter."""

    retry_s: float
    give_up_ns: int


@dataclass
class Counts:
    """What happened to events since the start."""

    delivered: int = 0
    failed_attempts: int = 0
    dead: int = 0


@dataclass
class Queue:
    """The queue of one webhook. One event loop owns it."""

    deliveries: Deliveries
    sender: Sender
    patience: Patience
    counts: Counts
    now_ns: Callable[[], int]
    failures: int = 0
    due_s: float = 0.0
    problem: str | None = None
    waiting: dict[str, float] = field(default_factory=dict)  # tags whose event was refused → when it is tried again

    async def run_once(self, client: httpx.AsyncClient, webhook: Webhook) -> bool:
        """Send the oldest event of several tags at the same time. Return whether there was something to send.

        While the receiver is not available, a single event is tried. Raises sqlite3.Error.
        """
        now_s = time.monotonic()
        if now_s < self.due_s:
            return False
        self.waiting = {tag: due_s for tag, due_s in self.waiting.items() if due_s > now_s}
        batch = self.deliveries.heads(webhook.id, 1 if self.failures else AT_ONCE, WINDOW, self.waiting)
        if batch and batch[0].t_ns < self.now_ns() - self.patience.give_up_ns:
            self._bury_old(webhook.id)
            return True
        outcomes = await asyncio.gather(*(self.sender.send(client, webhook, entry.body) for entry in batch))
        self._note(webhook.id, batch, outcomes)
        return bool(batch)

    def _note(self, webhook: str, batch: list[Delivery], outcomes: list[Outcome]) -> None:
        """Record the outcomes before anything else is sent."""
        by_verdict: dict[Verdict, list[tuple[Delivery, str]]] = {verdict: [] for verdict in Verdict}
        for entry, outcome in zip(batch, outcomes, strict=True):
            by_verdict[outcome.verdict].append((entry, outcome.detail))
        accepted = [entry.sequence for entry, _ in by_verdict[Verdict.ACCEPTED]]
        if accepted:
            self.deliveries.remove(webhook, accepted)
            self.counts.delivered += len(accepted)
            self.failures, self.problem = 0, None
        for entry, detail in by_verdict[Verdict.REFUSED]:
            self._on_refusal(webhook, entry, detail)
        unavailable = by_verdict[Verdict.UNAVAILABLE]
        self.counts.failed_attempts += len(unavailable) + len(by_verdict[Verdict.REFUSED])
        if unavailable:
            self.problem = unavailable[0][1]
            self.due_s = time.monotonic() + self._back_off(self.failures)
            self.failures += 1

    def _on_refusal(self, webhook: str, entry: Delivery, detail: str) -> None:
        self.problem, self.failures = detail, 0
        if entry.refusals + 1 >= MAX_REFUSALS:
            self.deliveries.bury(webhook, [entry.sequence], detail)
            self.counts.dead += 1
        else:
            self.deliveries.refuse(webhook, entry.sequence)
            self.waiting[entry.tag] = time.monotonic() + self._back_off(entry.refusals)

    def _bury_old(self, webhook: str) -> None:
        expired = self.deliveries.expired(webhook, self.now_ns() - self.patience.give_up_ns)
        reason = f"given up after {self.patience.give_up_ns / 3.6e12:g} hours: {self.problem}"
        self.deliveries.bury(webhook, expired, reason)
        self.counts.dead += len(expired)

    def _back_off(self, failures: int) -> float:
        """Return the time to the next attempt, s. It doubles, and varies so that receivers are not hit in step."""
        wait_s = min(FIRST_RETRY_S * 2.0 ** min(failures, 20), self.patience.retry_s)
        return wait_s * random.uniform(0.75, 1.0)

"""The thread that delivers events to all webhooks."""

import asyncio
import logging
import sqlite3
from collections.abc import Callable

from dropanchor_schemas.webhooks import Webhook
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.worker import Worker
from dropanchor_service.store.items import NamedItems
from dropanchor_service.webhooks.queue import Counts, Patience, Queue
from dropanchor_service.webhooks.sender import Sender

IDLE_S = 0.1
STOP_S = 2.0


class WebhookThread(Worker):
    """Delivers while this context is open. A slow receiver delays no other."""

    def __init__(
        self,
        webhooks: NamedItems[Webhook],
        deliveries: Deliveries,
        sender: Sender,
        patience: Patience,
        now_ns: Callable[[], int],
    ) -> None:
        super().__init__("webhooks", STOP_S)
        self._log = RareLog(logging.getLogger(__name__))
        self._webhooks = webhooks
        self._deliveries = deliveries
        self._sender = sender
        self._patience = patience
        self._now_ns = now_ns
        self._urls: dict[str, str] = {}  # a connection is checked for the host of one URL, so each URL gets its own
        self._queues: dict[str, Queue] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self.counts = Counts()

    def problem_of(self, webhook: str) -> str | None:
        """Return why the last attempt failed, None if it did not."""
        queue = self._queues.get(webhook)
        return None if queue is None else queue.problem

    def _run(self) -> None:
        asyncio.run(self._deliver_all())

    async def _deliver_all(self) -> None:
        while not self._stop.is_set():
            urls = {name: webhook.url for name, webhook in self._webhooks.all.items()}
            for name in [name for name, url in self._urls.items() if urls.get(name) != url]:
                await self._end(name)
            for name in urls.keys() - self._urls.keys():
                self._urls[name] = urls[name]
                self._tasks[name] = asyncio.create_task(self._deliver(name))
            for task in self._tasks.values():
                if task.done():
                    task.result()  # raises what ended it: the supervision ends the process
            await asyncio.sleep(IDLE_S)
        for task in self._tasks.values():
            task.cancel()

    async def _end(self, name: str) -> None:
        task = self._tasks.pop(name)
        task.cancel()
        await asyncio.wait([task])
        self._queues.pop(name, None)
        del self._urls[name]

    async def _deliver(self, name: str) -> None:
        """Empty the queue of one webhook, again and again."""
        queue = self._queues[name] = Queue(self._deliveries, self._sender, self._patience, self.counts, self._now_ns)
        async with self._sender.client() as client:
            while True:
                webhook = self._webhooks.all.get(name)
                try:
                    was_busy = webhook is not None and await queue.run_once(client, webhook)
                except sqlite3.Error as error:
                    self._log.warning(name, f"the queue cannot be read or written: {error}. It is tried again")
                    was_busy = False
                if not was_busy:
                    await asyncio.sleep(IDLE_S)

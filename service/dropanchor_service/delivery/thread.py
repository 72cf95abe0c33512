"""The thread that delivers events to all destinations."""

import asyncio
import logging
import sqlite3
from collections.abc import Callable

from dropanchor_schemas.destinations import Destination
from dropanchor_service.delivery.channel import Channel, ChannelError
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.queue import Counts, Patience, Queue
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.worker import Worker
from dropanchor_service.store.items import NamedItems

IDLE_S = 0.1
STOP_S = 2.0


class DeliveryThread(Worker):
    """Delivers while this context is open. A slow receiver delays no other."""

    def __init__(
        self,
        destinations: NamedItems[Destination],
        deliveries: Deliveries,
        channels: Channels,
        patience: Patience,
        now_ns: Callable[[], int],
    ) -> None:
        super().__init__("delivery", STOP_S)
        self._log = RareLog(logging.getLogger(__name__))
        self._destinations = destinations
        self._deliveries = deliveries
        self._channels = channels
        self._patience = patience
        self._now_ns = now_ns
        self._served: dict[str, Destination] = {}
        self._queues: dict[str, Queue] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self.counts = Counts()

    def problem_of(self, destination: str) -> str | None:
        """Return what went wrong at the last attempt, None if nothing did."""
        queue = self._queues.get(destination)
        return None if queue is None else queue.problem

    def _run(self) -> None:
        asyncio.run(self._deliver_all())

    async def _deliver_all(self) -> None:
        while not self._stop.is_set():
            wanted = self._destinations.all
            for name in [name for name, served in self._served.items() if wanted.get(name) != served]:
                await self._end(name)
            for name in wanted.keys() - self._served.keys():
                self._begin(wanted[name])
            for task in self._tasks.values():
                if task.done():
                    task.result()  # raises what ended it: the supervision ends the process
            await asyncio.sleep(IDLE_S)
        for name in list(self._tasks):
            await self._end(name)

    def _begin(self, destination: Destination) -> None:
        name = destination.id
        self._served[name] = destination
        self._queues[name] = Queue(name, self._deliveries, self._patience, self.counts, self._now_ns)
        self._tasks[name] = asyncio.create_task(self._deliver(destination, self._queues[name]))

    async def _end(self, name: str) -> None:
        task = self._tasks.pop(name)
        task.cancel()
        await asyncio.wait([task])
        del self._queues[name], self._served[name]

    async def _deliver(self, destination: Destination, queue: Queue) -> None:
        """Empty the queue of one destination, again and again."""
        try:
            self._channels.check_settings(destination)
        except ChannelError as error:
            queue.problem = str(error)
            return
        async with self._channels.open(destination) as channel:
            while True:
                if not await self._attempt(queue, channel):
                    await asyncio.sleep(IDLE_S)

    async def _attempt(self, queue: Queue, channel: Channel) -> bool:
        try:
            return await queue.run_once(channel)
        except sqlite3.Error as error:
            text = f"the queue cannot be read or written: {error}. It is tried again"
            self._log.warning(queue.destination, text)
            return False

"""The thread that delivers the events of all sites to all destinations."""

import asyncio
import logging
import sqlite3
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from dropanchor_schemas.destinations import Destination, MqttPosesDestination
from dropanchor_service.delivery.channel import ChannelError
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.live_site import LiveSite
from dropanchor_service.delivery.queue import FIRST_RETRY_S, REREAD_S, Counts, Patience, Queue, back_off_s
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.store import EventStore
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.worker import Worker
from dropanchor_service.store.items import NamedItems

STOP_S = 2.0

Name = tuple[int, str]
"""The index of a site, and the id of one of its destinations."""


@dataclass(frozen=True)
class Outbox:
    """The destinations of one site, its events and their queues, and what it has now."""

    destinations: NamedItems[Destination]
    store: EventStore
    deliveries: Deliveries
    channels: Channels
    live: LiveSite


class DeliveryThread(Worker):
    """Delivers while this context is open. Each queue has a task of its own, so a slow receiver delays no other.

    A queue is read when its site has stored events or a pause is over, so queues without events cost nothing.
    """

    def __init__(self, sites: Sequence[Outbox], patience: Patience, now_ns: Callable[[], int]) -> None:
        """sites: in the order of their indices."""
        super().__init__("delivery", STOP_S)
        self._log = RareLog(logging.getLogger(__name__))
        self._sites = sites
        self._patience = patience
        self._now_ns = now_ns
        self._edited = deque(range(len(sites)))
        self._with_news: deque[int] = deque()
        for index, site in enumerate(sites):
            site.destinations.on_change.append(partial(self._note, self._edited, index))
            site.store.on_commit.append(partial(self._note, self._with_news, index))
            site.deliveries.on_retry(partial(self._note, self._with_news, index))
        self._served: dict[Name, Destination] = {}
        self._queues: dict[Name, Queue] = {}
        self._problems: dict[Name, str | None] = {}  # of destinations without a queue
        self._tasks: dict[Name, asyncio.Task[None]] = {}
        self._ended: deque[asyncio.Task[None]] = deque()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._awake = asyncio.Event()
        self.counts = Counts()

    def _note(self, indices: deque[int], index: int) -> None:
        indices.append(index)
        self.wake()

    def wake(self) -> None:
        """See `Worker`. Here it is the loop that sleeps."""
        if self._loop is not None:
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._awake.set)

    def stop(self) -> None:
        self._stop.set()
        self.wake()
        super().stop()

    def problem_of(self, site: int, destination: str) -> str | None:
        """Return what went wrong at the last attempt, None if nothing did."""
        queue = self._queues.get((site, destination))
        return self._problems.get((site, destination)) if queue is None else queue.problem

    def _run(self) -> None:
        asyncio.run(self._deliver_all())

    async def _deliver_all(self) -> None:
        self._loop = asyncio.get_running_loop()
        while not self._stop.is_set():
            self._awake.clear()
            for index in _taken(self._edited):
                await self._follow(index)
            for index in _taken(self._with_news):
                for destination in self._sites[index].destinations.all:
                    if (index, destination) in self._queues:
                        self._queues[index, destination].news.set()
            while self._ended:
                task = self._ended.popleft()
                if not task.cancelled():
                    task.result()  # raises what ended it: the supervision ends the process
            await self._awake.wait()
        for name in list(self._tasks):
            await self._end(name)

    async def _follow(self, index: int) -> None:
        """Serve the destinations that a site has now."""
        wanted = self._sites[index].destinations.all
        served = {name: destination for (site, name), destination in self._served.items() if site == index}
        for changed in [name for name, destination in served.items() if wanted.get(name) != destination]:
            await self._end((index, changed))
        for new, destination in wanted.items():
            if (index, new) not in self._served:
                self._begin((index, new), destination)

    def _begin(self, name: Name, destination: Destination) -> None:
        site = self._sites[name[0]]
        self._served[name] = destination
        if isinstance(destination, MqttPosesDestination):
            work = self._publish(name, destination)
        else:
            queue = Queue(destination.id, site.deliveries, self._patience, self.counts, self._now_ns)
            self._queues[name] = queue
            work = self._deliver(destination, queue, site.channels)
        task = self._tasks[name] = asyncio.create_task(work)
        task.add_done_callback(self._on_end)

    def _on_end(self, task: asyncio.Task[None]) -> None:
        self._ended.append(task)
        self._awake.set()

    async def _end(self, name: Name) -> None:
        task = self._tasks.pop(name)
        task.cancel()
        await asyncio.wait([task])
        self._queues.pop(name, None)
        self._problems.pop(name, None)
        del self._served[name]

    async def _deliver(self, destination: Destination, queue: Queue, channels: Channels) -> None:
        """Empty the queue of one destination, again and again."""
        try:
            channels.check_settings(destination)
        except ChannelError as error:
            queue.problem = str(error)
            return
        async with channels.open(destination) as channel:
            while True:
                try:
                    is_empty = not await queue.run_once(channel)
                except sqlite3.Error as error:
                    text = f"the queue cannot be read or written: {error}. It is tried again"
                    self._log.warning(queue.destination, text)
                    is_empty, queue.due_s = True, time.monotonic() + REREAD_S
                if is_empty:
                    await queue.rest()

    async def _publish(self, name: Name, destination: MqttPosesDestination) -> None:
        """Publish the poses and zones of a site, again and again."""
        site, failures = self._sites[name[0]], 0
        try:
            site.channels.check_settings(destination)
        except ChannelError as error:
            self._problems[name] = str(error)
            return
        if not destination.enabled:
            return
        async with site.channels.open_poses(destination, site.live) as feed:
            try:
                while True:
                    self._problems[name] = await feed.publish()
                    failures = failures + 1 if feed.is_away else 0
                    pause_s = back_off_s(FIRST_RETRY_S, failures - 1, self._patience.retry_s)
                    await asyncio.sleep(pause_s if failures else feed.pause_s)
            finally:
                if not self._stop.is_set() and _is_elsewhere(site.destinations.all.get(destination.id), destination):
                    await feed.clear()


def _is_elsewhere(now: Destination | None, before: MqttPosesDestination) -> bool:
    """Return whether a destination that was deleted or changed no longer publishes to the same topics."""
    if not isinstance(now, MqttPosesDestination):
        return True
    return (now.prefix, now.discovery) != (before.prefix, before.discovery)


def _taken(indices: deque[int]) -> set[int]:
    """Take all indices."""
    return {indices.popleft() for _ in range(len(indices))}

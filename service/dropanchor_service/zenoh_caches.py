"""Asks the caches of the tags' publishers for what was published while nobody listened.

Not with the history of Zenoh's own advanced subscriber: together with recovery, and many publishers that are live, that
loses thousands of samples.
"""

import logging
import threading
import time
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from types import TracebackType
from typing import Any, Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_service.buffer import MessageBuffer
from dropanchor_service.catch_up import CatchUp
from dropanchor_service.clock import UtcClock
from dropanchor_service.logs import RareLog
from dropanchor_service.metrics import Metrics
from dropanchor_service.publishers import Publishers
from dropanchor_service.store import TagTable

ANSWER_S = 2.0
FEWEST = 100  # messages that a cache is asked for
PER_SECOND = 200  # and more, for every second that the tag was not heard: no publisher sends as many

_log = logging.getLogger(__name__)


class ZenohCaches:
    """A thread of its own while it is open, since callbacks of Zenoh must not call it. Open it once samples are
    subscribed to: what is published from then on comes by itself."""

    def __init__(
        self,
        session: zenoh.Session,
        site: str,
        buffer: MessageBuffer,
        tags: TagTable,
        publishers: Publishers,
        metrics: Metrics,
        clock: UtcClock,
    ) -> None:
        self._rare = RareLog(_log)
        self._session = session
        self._site = site
        self._tags = tags
        self._publishers = publishers
        self._metrics = metrics
        self._clock = clock
        self._tasks: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        expected = [keys.samples_key(site, tag.name) for tag in tags.all()]
        self.catch_up = CatchUp(
            buffer, expected, self._is_repeated, lambda key: self._tasks.put(partial(self._ask, key))
        )
        self._thread = threading.Thread(target=self._run, name="caches", daemon=True)

    def __enter__(self) -> Self:
        self._tasks.put(self._ask_all)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._tasks.put(None)
        self._thread.join(1.0)

    def _is_repeated(self, key: str, boot_id: int, sequence: int) -> bool:
        tag = self._tags.find(keys.tag_from_key(key))
        return tag is not None and self._publishers.has_passed(tag.row, boot_id, sequence)

    def _run(self) -> None:
        while (task := self._tasks.get()) is not None:
            try:
                task()
            except Exception as error:
                self._metrics.faults.labels("caches").inc()
                self._rare.exception("caches", error)

    def _ask_all(self) -> None:
        newest_ns = max((tag.last_heard_ns or 0 for tag in self._tags.all()), default=0)
        self._get(keys.all_tags(self._site, "samples"), newest_ns, self.catch_up.first_round_answered)

    def _ask(self, key: str) -> None:
        tag = self._tags.find(keys.tag_from_key(key))
        heard_ns = None if tag is None else tag.last_heard_ns
        self._get(key, heard_ns or 0, partial(self.catch_up.answered, key))

    def _get(self, samples: str, heard_ns: int, answered: Callable[[], int]) -> None:
        """Ask for all since then; `answered` is run in our thread."""
        done = partial(self._tasks.put, partial(self._finish, answered, time.monotonic()))
        try:
            self._session.get(
                f"{samples}/@adv/**?_max={self._most(heard_ns)}",
                zenoh.handlers.Callback(self._on_reply, done),
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                accept_replies=zenoh.ReplyKeyExpr.ANY,
                timeout=ANSWER_S,
            )
        except zenoh.ZError:
            answered()
            raise

    def _most(self, heard_ns: int) -> int:
        silent_s = (self._clock.now_ns() - heard_ns) * 1e-9 if heard_ns else 0.0
        return FEWEST + round(PER_SECOND * max(silent_s, 0.0))

    def _on_reply(self, reply: Any) -> None:
        message = reply.ok
        if message is not None:
            now_ns = self._clock.now_ns()
            self.catch_up.fetch(str(message.key_expr), bytes(message.payload), str(message.encoding), now_ns)

    def _finish(self, answered: Callable[[], int], asked_s: float) -> None:
        messages = answered()
        self._metrics.caught_up.inc(messages)
        if messages:
            _log.debug("caches answered in %.2f s; %d messages go on", time.monotonic() - asked_s, messages)

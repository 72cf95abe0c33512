"""Asks the caches of the tags' publishers for what was published while nobody listened.

Not with the history of Zenoh's own advanced subscriber: together with recovery, and many publishers that are live, that
loses thousands of samples.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np
import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.wire import payload_encoding
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.store import TagTable
from dropanchor_service.zenoh_io.channel import received

ANSWER_S = 2.0
FEWEST = 100  # messages that a cache is asked for
PER_SECOND = 200  # and more, for every second that the tag was not heard: no publisher sends as many
NINE_OF_TEN = 0.9  # tags have sent all that they are asked for in the first round; the others are asked again
SPARE = 1.2
PAUSE_S = 0.1  # before the same tag is asked again
REPLIES = 2**16  # that may wait for us: a receive thread that waited for the interpreter would hold up what is live

_log = logging.getLogger(__name__)


class ZenohCaches:
    """Asks on a thread of its own, since callbacks of Zenoh must not call it. Start it once samples are subscribed to:
    what is published from then on arrives live."""

    def __init__(
        self,
        session: zenoh.Session,
        site: str,
        tags: TagTable,
        metrics: Metrics,
        clock: UtcClock,
    ) -> None:
        self._rare = RareLog(_log)
        self._session = session
        self._site = site
        self._tags = tags
        self._metrics = metrics
        self._clock = clock
        self._later: deque[tuple[float, str, int]] = deque()  # to be asked again, and when
        self._tasks: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._newest_ns = max((tag.last_heard_ns or 0 for tag in tags.all()), default=0)  # by the last process
        self._thread = threading.Thread(target=self._run, name="caches", daemon=True)

    @property
    def new_publisher_limit(self) -> int:
        """Number of messages to ask for from a publisher that the last process did not know."""
        return self._most(self._newest_ns)

    def start(self, catch_up: CatchUp) -> None:
        """Ask all caches, and pass their replies to `catch_up`."""
        self._catch_up = catch_up
        self._tasks.put(self._ask_all)
        self._thread.start()

    def stop(self) -> None:
        self._tasks.put(None)
        self._thread.join(1.0)

    def ask(self, key: str, missing: int, retries: int) -> None:
        """Ask the caches of a tag for `missing` messages (0: unknown), on the thread; a retry waits for a moment."""
        if retries:
            self._later.append((time.monotonic() + PAUSE_S, key, missing))
        self._tasks.put(self._ask_later if retries else partial(self._ask, key, missing))

    def _run(self) -> None:
        while True:
            try:
                task = self._tasks.get(timeout=PAUSE_S if self._later else None)
            except Empty:
                task = self._ask_later
            if task is None:
                return
            try:
                task()
            except Exception as error:
                self._metrics.faults.labels("caches").inc()
                self._rare.exception("caches", error)

    def _ask_later(self) -> None:
        """Those whose time has come."""
        while self._later and self._later[0][0] <= time.monotonic():
            _, key, missing = self._later.popleft()
            self._ask(key, missing)

    def _ask_all(self) -> None:
        most, asked_s = min(self._usual(), self._most(self._newest_ns)), time.monotonic()
        try:
            replies = self._asked(keys.all_tags(self._site, "samples"), most, zenoh.handlers.FifoChannel(REPLIES))
            for reply in received(replies):
                self._on_reply(reply)
        finally:
            self._finish(partial(self._catch_up.on_first_round_answer, most), asked_s)

    def _ask(self, key: str, missing: int) -> None:
        tag = self._tags.find(keys.tag_from_key(key))
        heard_ns = None if tag is None else tag.last_heard_ns
        most = FEWEST + missing if missing else self._most(heard_ns or 0)
        answered = partial(self._catch_up.on_answer, key, most)
        done = partial(self._tasks.put, partial(self._finish, answered, time.monotonic()))
        try:
            self._asked(key, most, zenoh.handlers.Callback(self._on_reply, done))
        except zenoh.ZError:
            answered()
            raise

    def _asked(self, samples: str, most: int, handler: Any) -> Any:
        """Ask for the newest `most`."""
        return self._session.get(
            f"{samples}/@adv/**?_max={most}",
            handler,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            accept_replies=zenoh.ReplyKeyExpr.ANY,
            timeout=ANSWER_S,
        )

    def _usual(self) -> int:
        """How many messages most tags have sent since the last process heard them, if they went on as before."""
        counts = self._tags.copy_counts()
        heard = counts[counts["messages"] > 0]
        if not len(heard):
            return FEWEST
        heard_s = np.maximum((heard["last_heard_ns"] - heard["first_heard_ns"]) * 1e-9, 1.0)
        rate = float(np.quantile(heard["messages"] / heard_s, NINE_OF_TEN))
        return FEWEST // 5 + round(SPARE * rate * self._silent_s(self._newest_ns))

    def _most(self, heard_ns: int) -> int:
        return FEWEST + round(PER_SECOND * self._silent_s(heard_ns))

    def _silent_s(self, heard_ns: int) -> float:
        return max((self._clock.now_ns() - heard_ns) * 1e-9, 0.0) if heard_ns else 0.0

    def _on_reply(self, reply: Any) -> None:
        message = reply.ok
        if message is not None:
            now_ns = self._clock.now_ns()
            encoding = payload_encoding(str(message.encoding))
            self._catch_up.on_cached(str(message.key_expr), bytes(message.payload), encoding, now_ns)

    def _finish(self, answered: Callable[[], int], asked_s: float) -> None:
        messages = answered()
        self._metrics.caught_up.inc(messages)
        if messages:
            _log.debug("caches answered in %.2f s; %d messages go on", time.monotonic() - asked_s, messages)

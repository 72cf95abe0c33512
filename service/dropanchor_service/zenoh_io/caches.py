"""Queries the caches of the tags' publishers for messages that were published while the service was not subscribed.

The history option of Zenoh's advanced subscriber could do this too. Combined with recovery and many live publishers it
loses thousands of samples, so it is not used.
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

from dropanchor_schemas.wire import payload_encoding
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.store import Sites
from dropanchor_service.zenoh_io.channel import drain
from dropanchor_service.zenoh_io.open_queries import REPLIES, OpenQueries
from dropanchor_service.zenoh_io.silent_tags import SilentTags

ANSWER_S = 2.0
MIN_MESSAGES = 100  # that a cache is asked for where nobody knows the rate of its tag
MESSAGES_PER_S = 200  # asked for in addition, per second of silence; no publisher sends as many
SPARE_MESSAGES = 20  # asked for in addition where it is known; what is missing then is asked for again
RATE_QUANTILE = 0.9  # of the tags' rates; the first round covers these tags, the others are asked again
MARGIN = 1.2  # on the number of messages that a rate predicts
RETRY_S = 0.1  # pause before the same tag is asked again
SILENT_S = 1.0  # after it came back online, until a tag counts as silent
CHECK_S = 1.0  # between two searches for tags that have fallen silent
CHECKED_TAGS = 20  # of these at a time, so that a service that is stuck asks few
POLL_S = 0.005  # between two looks at the replies to open queries
# A tag's heartbeats come from the thread that watches its socket. In one queue with replies that wait for the socket, a
# heartbeat waits too, and then nobody watches. The replies have the priority of the query.
BEHIND_LIVE_MESSAGES = zenoh.Priority.DATA_LOW
MAX_OPEN = 64  # queries at a time; more would fill the links, on which live messages are dropped then

_log = logging.getLogger(__name__)


class ZenohCaches:
    """Queries the caches from its own thread, because Zenoh callbacks must not call Zenoh.

    Start it after subscribing to the samples, so that no message falls between the two.
    """

    def __init__(
        self,
        session: zenoh.Session,
        sites: Sites,
        metrics: Metrics,
        clock: UtcClock,
        on_first_round: Callable[[], None] = lambda: None,
    ) -> None:
        """on_first_round: called once all caches have been asked, on the thread of this."""
        self._rare = RareLog(_log)
        self._session = session
        self._sites = sites
        self._metrics = metrics
        self._clock = clock
        self._on_first_round = on_first_round
        self._later: deque[tuple[float, str, int]] = deque()  # queries to repeat: when, key, missing
        self._asked: deque[tuple[str, int]] = deque()  # queries that wait for others to end: key, missing
        self._open = OpenQueries()
        self._returned: deque[tuple[float, str, int]] = deque()  # tags online again: when to look, key, last heard ns
        self._silent_tags = SilentTags(sites.rows)
        self._next_check_s = 0.0
        self._tasks: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._newest_ns = max(
            (tag.last_heard_ns or 0 for tag in sites.rows.all()), default=0
        )  # before this process started
        # No daemon: Zenoh's threads for callbacks inherit that, and one that outlives Python aborts the process.
        self._thread = threading.Thread(target=self._run, name="caches")

    @property
    def new_publisher_limit(self) -> int:
        """Number of messages to ask for from a publisher that the last process did not know."""
        return self._limit(self._newest_ns)

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
            self._later.append((time.monotonic() + RETRY_S, key, missing))
        self._tasks.put(self._ask_later if retries else partial(self._asked.append, (key, missing)))

    def ask_if_silent(self, key: str) -> None:
        """Ask the caches of a tag that came online and sends nothing, for what it sent while it was away.

        Zenoh itself fetches what is missing before a live message. See also `_check_silent`.
        """
        heard_ns = self._last_heard_ns(key)
        if heard_ns:
            self._tasks.put(partial(self._returned.append, (time.monotonic() + SILENT_S, key, heard_ns)))

    def _run(self) -> None:
        while True:
            try:
                task = self._tasks.get(timeout=self._pause_s())
            except Empty:
                task = self._on_idle
            if task is None:
                return
            try:
                task()
                self._poll()
            except Exception as error:
                self._metrics.faults["caches"].inc()
                self._rare.exception("caches", error)

    def _pause_s(self) -> float:
        if self._open:
            return POLL_S
        return RETRY_S if self._later or self._returned else CHECK_S

    def _poll(self) -> None:
        """Pass on replies, and ask what had to wait for others to be answered."""
        self._open.poll()
        while self._asked and len(self._open) < MAX_OPEN:
            self._ask(*self._asked.popleft())

    def _on_idle(self) -> None:
        self._ask_later()
        if time.monotonic() >= self._next_check_s:
            self._next_check_s = time.monotonic() + CHECK_S
            self._check_silent()

    def _check_silent(self) -> None:
        """Ask the caches of tags that have fallen silent for their newest message, which may have been lost on its way.

        After a heartbeat of the publisher, Zenoh fetches such messages itself, but not on keys with a verbatim chunk
        such as `@v1`; `test_heartbeats` shows both.
        """
        for row in self._silent_tags.take(self._clock.now_ns(), CHECKED_TAGS):
            key = self._sites.samples_key(row)
            self._open.add(self._get(key, 1), partial(self._on_newest, key, row))

    def _on_newest(self, key: str, row: int, reply: Any) -> None:
        message = reply.ok
        if message is None:  # no cache has answered in time
            self._silent_tags.return_again(row)
        else:
            self._catch_up.on_newest(key, bytes(message.payload), payload_encoding(str(message.encoding)))

    def _ask_later(self) -> None:
        """Repeat the queries that are due, and ask the caches of tags that came back and are silent."""
        while self._later and self._later[0][0] <= time.monotonic():
            _, key, missing = self._later.popleft()
            self._asked.append((key, missing))
        while self._returned and self._returned[0][0] <= time.monotonic():
            _, key, heard_ns = self._returned.popleft()
            if self._last_heard_ns(key) == heard_ns:
                self._catch_up.on_silent(key)

    def _ask_all(self) -> None:
        limit, asked_s = min(self._typical_limit(), self._limit(self._newest_ns)), time.monotonic()
        try:
            for reply in drain(self._get(self._sites.all_tags("samples"), limit)):
                self._on_reply(reply)
        finally:
            self._finish(partial(self._catch_up.on_first_round_answer, limit), asked_s)
            self._on_first_round()

    def _ask(self, key: str, missing: int) -> None:
        limit = SPARE_MESSAGES + missing if missing else self._predicted(key)
        answered = partial(self._catch_up.on_answer, key, limit)
        try:
            self._open.add(self._get(key, limit), self._on_reply, partial(self._finish, answered, time.monotonic()))
        except zenoh.ZError:
            answered()
            raise

    def _get(self, samples: str, limit: int) -> Any:
        """Query the caches of these keys for their newest `limit` messages. Return the channel of the replies."""
        return self._session.get(
            f"{samples}/@adv/**?_max={limit}",
            zenoh.handlers.FifoChannel(REPLIES),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            accept_replies=zenoh.ReplyKeyExpr.ANY,
            priority=BEHIND_LIVE_MESSAGES,
            timeout=ANSWER_S,
        )

    def _typical_limit(self) -> int:
        """Return how many messages most tags have sent since the last process stopped, at their former rates."""
        counts = self._sites.rows.copy_counts()
        heard = counts[counts["messages"] > 0]
        if not len(heard):
            return MIN_MESSAGES
        return self._sent_since(self._newest_ns, float(np.quantile(_rates(heard), RATE_QUANTILE)))

    def _predicted(self, key: str) -> int:
        """Return how many messages a tag has sent since it was last heard, at its former rate."""
        tag = self._sites.tag_of(key)
        if tag is None or not tag.last_heard_ns:
            return self._limit(0)
        counts = tag.rows.counts(tag.row)
        return min(self._sent_since(tag.last_heard_ns, float(_rates(counts))), self._limit(tag.last_heard_ns))

    def _sent_since(self, heard_ns: int, rate: float) -> int:
        return SPARE_MESSAGES + round(MARGIN * rate * self._silent_s(heard_ns))

    def _last_heard_ns(self, key: str) -> int:
        tag = self._sites.tag_of(key)
        return 0 if tag is None else tag.last_heard_ns or 0

    def _limit(self, last_heard_ns: int) -> int:
        """Return how many messages a tag can have sent since it was last heard, at most."""
        return MIN_MESSAGES + round(MESSAGES_PER_S * self._silent_s(last_heard_ns))

    def _silent_s(self, last_heard_ns: int) -> float:
        return max((self._clock.now_ns() - last_heard_ns) * 1e-9, 0.0) if last_heard_ns else 0.0

    def _on_reply(self, reply: Any) -> None:
        message = reply.ok
        if message is not None and self._sites.serves(str(message.key_expr)):
            now_ns = self._clock.now_ns()
            encoding = payload_encoding(str(message.encoding))
            self._catch_up.on_cached(str(message.key_expr), bytes(message.payload), encoding, now_ns)

    def _finish(self, answered: Callable[[], int], asked_s: float) -> None:
        messages = answered()
        self._metrics.caught_up.inc(messages)
        if messages:
            _log.debug("the caches answered in %.2f s and added %d messages", time.monotonic() - asked_s, messages)


def _rates(counts: Any) -> Any:
    """Return the messages per second of tags that were heard."""
    return counts["messages"] / np.maximum((counts["last_heard_ns"] - counts["first_heard_ns"]) * 1e-9, 1.0)

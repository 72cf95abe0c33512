"""A publisher that keeps messages on disk while nobody can receive them, and sends them later in their order."""

import logging
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import zenoh

from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, HEADER
from dropanchor_tag_client.link import LOST_LINK_S, Linker, TagKeys
from dropanchor_tag_client.session import SessionSettings
from dropanchor_tag_client.spool import Spool

# The service recognises duplicates among the last 1,024 messages of a publisher. What may be sent again stays below.
_RECENT_MESSAGES = 900
_CHUNK_MESSAGES, _CHUNK_BYTES, _CHUNK_S = 100, 32_768, 0.1
_PENDING_MESSAGES = 2_000
_POLL_S, _SYNC_S, _LOG_EVERY_S = 0.1, 1.0, 10.0
_CLOSE_UNLINKED_S, _CLOSE_LINKED_S = 2.0, 5.0

_log = logging.getLogger(__name__)


class SpoolCounts(NamedTuple):
    """waiting_bytes: on disk. sent: messages sent from the spool. dropped: messages that were deleted or not written,
    because the spool or the disk was full. damaged: places in the files that held no valid message. oldest_ns: UTC of
    the oldest message that is being sent from the spool, None if there is none."""

    waiting_bytes: int
    sent: int
    dropped: int
    damaged: int
    oldest_ns: int | None = None


class _Chunk(NamedTuple):
    """The oldest messages of the spool.

    dropped_before: number that the spool had dropped when they were sent. is_delivered: whether the router has them.
    """

    messages: int
    dropped_before: int
    is_delivered: Callable[[], bool]


class SpoolingPublisher:
    """Publish at once while somebody subscribes, else write to the spool. `put` never blocks on the disk.

    While the spool holds messages, new ones go behind them, so that the order stays. The publisher owns the spool.
    """

    def __init__(
        self,
        spool: Spool,
        connect: SessionSettings | zenoh.Session,
        tag_keys: TagKeys,
        declare: Callable[[zenoh.Session], Any],
        cache_messages: int,
        encoding_schema: str,
    ) -> None:
        """declare: declares the publisher in a session. cache_messages: the number of messages that it keeps.
        encoding_schema: what follows the encoding of a message, "" for nothing."""
        self._spool = spool
        self._chunk_messages = max(1, min(_CHUNK_MESSAGES, cache_messages // 6))
        self._encoding_schema = encoding_schema
        self._condition = threading.Condition()
        self._pending: deque[bytes] = deque()  # to be written to the spool
        self._recent: deque[tuple[float, bytes]] = deque(maxlen=_RECENT_MESSAGES)  # sent at once, and when
        self._chunk: _Chunk | None = None  # sent, but still in the spool
        self._is_live = False
        self._close_by_s: float | None = None
        self._sent = self._unwritten = 0
        self._unsynced = False
        self._logged_dropped = 0
        self._oldest_ns: int | None = None
        self._sync_s = self._next_log_s = self._next_chunk_s = 0.0
        self._name = tag_keys.samples
        self._linker = Linker(connect, tag_keys, declare, self._wake)
        self._thread = threading.Thread(target=self._run, name=f"spool {self._name}", daemon=True)
        self._thread.start()

    @property
    def session(self) -> zenoh.Session | None:
        """Return the session, None before the first connection."""
        link = self._linker.link
        return None if link is None else link.session

    @property
    def counts(self) -> SpoolCounts:
        spool = self._spool
        return SpoolCounts(
            spool.used_bytes, self._sent, spool.dropped + self._unwritten, spool.damaged, self._oldest_ns
        )

    def put(self, payload: bytes) -> None:
        with self._condition:
            link = self._linker.link
            if self._is_live and link is not None and link.has_subscriber:
                self._recent.append((time.monotonic(), payload))
                link.put(payload, self._encoding(payload))
                return
            self._leave_live()
            if len(self._pending) < _PENDING_MESSAGES:
                self._pending.append(payload)
            else:
                self._unwritten += 1
            self._condition.notify()

    def undeclare(self) -> None:
        """Send what can be sent within a few seconds, and disconnect. The rest stays on disk for the next start."""
        with self._condition:
            link = self._linker.link
            linked = link is not None and link.has_subscriber
            self._close_by_s = time.monotonic() + (_CLOSE_LINKED_S if linked else _CLOSE_UNLINKED_S)
            self._condition.notify()
        self._thread.join()
        self._linker.close()
        self._spool.close()

    def _leave_live(self) -> None:
        """Send the last messages again: the link may have been down already. The service drops duplicates."""
        if not self._is_live:
            return
        self._is_live = False
        _log.warning("%s: the service cannot be reached; messages go to the spool", self._name)
        since_s = time.monotonic() - LOST_LINK_S
        self._pending.extend(payload for sent_s, payload in self._recent if sent_s >= since_s)
        self._recent.clear()

    def _wake(self) -> None:
        with self._condition:
            self._condition.notify()

    def _run(self) -> None:
        while not self._is_done():
            try:
                self._write_pending()
                self._remove_delivered()
                self._send_chunk()
            except (OSError, zenoh.ZError) as error:
                self._warn(f"the spool cannot be sent: {error}")
                time.sleep(_POLL_S)
        self._write_pending()

    def _is_done(self) -> bool:
        """Wait for something to do. Return whether to end."""
        with self._condition:
            if not self._pending and not self._may_end():
                self._condition.wait(None if self._is_live and self._chunk is None else _POLL_S)
            return self._may_end()

    def _may_end(self) -> bool:
        if self._close_by_s is None:
            return False
        return time.monotonic() > self._close_by_s or (self._spool.is_empty and not self._pending)

    def _write_pending(self) -> None:
        with self._condition:
            pending, self._pending = self._pending, deque()
        for payload in pending:
            try:
                self._spool.append(payload)
                self._unsynced = True
            except OSError as error:
                self._unwritten += 1
                self._warn(f"a message could not be written to the spool: {error}; free some space")
        if self._spool.dropped > self._logged_dropped:
            self._logged_dropped = self._spool.dropped
            self._warn(f"the spool was full: its oldest {self._logged_dropped} messages were deleted so far")
        if self._unsynced and time.monotonic() >= self._sync_s:
            self._spool.sync()
            self._unsynced, self._sync_s = False, time.monotonic() + _SYNC_S

    def _send_chunk(self) -> None:
        link, now_s = self._linker.link, time.monotonic()
        if link is None or self._chunk is not None or now_s < self._next_chunk_s or not link.has_subscriber:
            return
        self._next_chunk_s = now_s + _CHUNK_S
        messages = self._spool.peek(self._chunk_messages, _CHUNK_BYTES)
        with self._condition:
            is_last = not self._pending and self._spool.ends_after(len(messages))
            for message in messages:
                link.put(message, self._encoding(message))
            if is_last and not self._is_live:
                self._go_live(messages, now_s)
        if messages:
            self._oldest_ns = first_ns(messages[0])
            self._chunk = _Chunk(len(messages), self._spool.dropped, link.delivery())

    def _go_live(self, last: list[bytes], now_s: float) -> None:
        """Send messages at once from now on. The last ones of the spool were just sent."""
        self._is_live = True
        self._recent.extend((now_s, message) for message in last)
        _log.info("%s: connected; %d messages were sent from the spool", self._name, self._sent + len(last))

    def _remove_delivered(self) -> None:
        """Remove the chunk that was sent from the spool, if it was delivered. Else it will be sent again."""
        chunk, link = self._chunk, self._linker.link
        if chunk is None or link is None:
            return
        if not link.has_subscriber:
            self._chunk = None
            with self._condition:
                self._leave_live()
        elif chunk.is_delivered():
            self._chunk = None
            if chunk.dropped_before == self._spool.dropped:  # else a part of it is no longer in the spool
                self._spool.remove(chunk.messages)
                self._sent += chunk.messages
            if self._spool.is_empty:
                self._oldest_ns = None

    def _warn(self, text: str) -> None:
        if time.monotonic() >= self._next_log_s:
            self._next_log_s = time.monotonic() + _LOG_EVERY_S
            _log.warning("%s: %s", self._name, text)

    def _encoding(self, payload: bytes) -> str:
        """Return the encoding of a payload, whichever program wrote it."""
        return (ENCODING_JSON if payload.startswith(b"{") else ENCODING_PACKED) + self._encoding_schema


def first_ns(payload: bytes) -> int | None:
    """Return the time of the first sample in a payload of ours, packed or JSON."""
    if payload.startswith(b"{"):
        return min(map(int, re.findall(rb'"t_ns":(\d+)', payload)), default=None)
    return int(HEADER.unpack_from(payload)[7]) if len(payload) >= HEADER.size else None

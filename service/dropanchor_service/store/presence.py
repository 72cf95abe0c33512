"""Which tags are online: by a liveliness token, an open WebSocket, or messages over HTTP that came a short time ago."""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import RLock

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.records import enlarged

HTTP_S = 30.0  # for which a message over HTTP makes its tag online


class OnlineUntil:
    """By row of any site: when its tag goes offline unless another message arrives, s of the clock."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.clock = clock
        self.lock = RLock()
        self.s = np.zeros(16)

    def grow(self, rows: int) -> None:
        """Make room for this many rows."""
        if rows > len(self.s):
            self.s = enlarged(self.s, 2 * rows)

    def are_online(self, rows: Array) -> Array:
        """Return whether the tag of each row is online."""
        online: Array = self.s[rows] > self.clock()
        return online


class Presence:
    """Thread-safe. Knows the names of one site, some of which have a row. clock: monotonic, s. until: of all sites."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, until: OnlineUntil | None = None) -> None:
        self._until = until or OnlineUntil(clock)
        self._clock = self._until.clock
        self._lock = self._until.lock
        self._tokens: set[str] = set()
        self._connections: Counter[str] = Counter()
        self._rows: dict[str, int] = {}

    def add_row(self, name: str, row: int) -> None:
        """Note that a name has got its row."""
        with self._lock:
            self._until.grow(row + 1)
            self._rows[name] = row
            self._update(name)

    def set_token(self, name: str, present: bool) -> None:
        """Set whether a name has a liveliness token."""
        with self._lock:
            (self._tokens.add if present else self._tokens.discard)(name)
            self._update(name)

    @contextmanager
    def connected(self, name: str) -> Iterator[None]:
        """Count an open WebSocket of a name until the block ends."""
        self._count_connection(name, 1)
        try:
            yield
        finally:
            self._count_connection(name, -1)

    def note_http_message(self, name: str) -> None:
        """Note a message over HTTP. It counts only for a name with a row: made-up names must take no memory."""
        with self._lock:
            row = self._rows.get(name)
            if row is not None:
                self._until.s[row] = max(self._until.s[row], self._clock() + HTTP_S)

    def is_online(self, name: str) -> bool:
        """Return whether a name is online."""
        row = self._rows.get(name)
        return self._is_connected(name) if row is None else bool(self._until.s[row] > self._clock())

    def are_online(self, rows: Array) -> Array:
        """Return whether the tag of each row is online."""
        return self._until.are_online(rows)

    @property
    def tokens(self) -> int:
        """The number of names with a liveliness token."""
        return len(self._tokens)

    def count(self) -> int:
        """Return the number of names that are online, with or without a row."""
        with self._lock:
            without_row = sum(name not in self._rows for name in {*self._tokens, *self._connections})
            rows = np.fromiter(self._rows.values(), np.int64, len(self._rows))
            return without_row + int(np.count_nonzero(self.are_online(rows)))

    def _count_connection(self, name: str, change: int) -> None:
        with self._lock:
            self._connections[name] += change
            self._connections += Counter()  # drops what is zero
            self._update(name)

    def _is_connected(self, name: str) -> bool:
        return name in self._tokens or name in self._connections

    def _update(self, name: str) -> None:
        row = self._rows.get(name)
        if row is not None:
            self._until.s[row] = math.inf if self._is_connected(name) else 0.0

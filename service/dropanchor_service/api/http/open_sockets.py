"""Bound the number of open connections, so that clients which say nothing keep out nobody.

When there are too many, the connection that has been silent for longest is closed for a new one. asyncio alone accepts
until the process has no file left for a checkpoint, and then writes a traceback for each connection.
"""

import errno
import logging
import socket
import time
from contextlib import suppress
from typing import Any

ENDING = 16  # connections that may be open beyond the limit, until those that were closed for them have ended
NO_FILES_S = 1.0  # for which nothing is accepted after the process had no file left

_log = logging.getLogger(__name__)


class OpenSockets:
    """The open connections of a listener, by file descriptor. Owned by one thread.

    A connection is silent while no request of it is processed.
    """

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self._open: dict[int, socket.socket] = {}
        self._silent: dict[int, socket.socket] = {}  # the one that has been silent for longest is the first
        self._ending: set[int] = set()

    def __len__(self) -> int:
        return len(self._open)

    @property
    def are_still_ending(self) -> bool:
        """Return whether connections that were closed for new ones take all the room that there is beyond the limit."""
        return len(self._open) >= self.limit + ENDING

    def add(self, opened: socket.socket) -> None:
        self._open[opened.fileno()] = self._silent[opened.fileno()] = opened

    def remove(self, number: int) -> None:
        for by_number in (self._open, self._silent):
            by_number.pop(number, None)
        self._ending.discard(number)

    def note_busy(self, number: int) -> None:
        """Note that the connection has sent a request."""
        self._silent.pop(number, None)

    def note_silent(self, number: int) -> None:
        """Note that the connection was answered."""
        if number in self._open:
            self._silent[number] = self._open[number]

    def make_room(self) -> bool:
        """Make room for one more by closing the one that has been silent for longest. Return False if there is none."""
        if len(self._open) - len(self._ending) < self.limit:
            return True
        if not self._silent:
            _log.warning("a connection is refused: all %d are busy", self.limit)
            return False
        number, opened = next(iter(self._silent.items()))
        self.note_busy(number)
        self._ending.add(number)
        _log.warning("there are %d connections, so the silent ones are closed for new ones", self.limit)
        with suppress(OSError):  # the client has closed it already
            opened.shutdown(socket.SHUT_RDWR)
        return True


class _Accepted(socket.socket):
    """A connection that is removed from the open ones when it is closed."""

    def __init__(self, accepted: socket.socket, of: OpenSockets) -> None:
        super().__init__(accepted.family, accepted.type, accepted.proto, accepted.detach())
        self._of = of
        of.add(self)

    def close(self) -> None:
        self._of.remove(self.fileno())
        super().close()


class Listener(socket.socket):
    """A listening socket that accepts no more connections than its `connections` allow."""

    def __init__(self, family: int, kind: int, protocol: int, limit: int) -> None:
        super().__init__(family, kind, protocol)
        self.connections = OpenSockets(limit)
        self._no_files_s = -NO_FILES_S

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept a connection. Raises BlockingIOError to be called again later."""
        if time.monotonic() - self._no_files_s < NO_FILES_S:
            raise BlockingIOError(errno.EAGAIN, "no file was left a moment ago")
        if self.connections.are_still_ending:
            raise BlockingIOError(errno.EAGAIN, "the connections that were closed for others still end")
        try:
            accepted, address = super().accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                self._no_files_s = time.monotonic()
            raise
        if not self.connections.make_room():
            accepted.close()
            raise ConnectionAbortedError(errno.ECONNABORTED, "all connections are busy")
        return _Accepted(accepted, self.connections), address

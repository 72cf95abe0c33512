"""Close the connections of a router without waiting for tags that have vanished.

A tag that vanishes (no power, no Wi-Fi) leaves data unacknowledged. Zenoh sets `SO_LINGER` on its TCP and TLS sockets,
so that `close` would block a receive thread for up to 10 s, and all tags that this thread serves would be silent. Zenoh
has no setting for it. Without the option, the kernel sends what is left while `close` returns at once.
"""

import os
import socket
import stat
import struct
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import zenoh

from dropanchor_service.runtime.worker import Worker

PERIOD_S = 1.0  # between two looks at the open sockets; Zenoh closes a silent connection after 4 s
_FILES = "/dev/fd"
_NO_LINGER = struct.pack("ii", 0, 0)


class PromptClosing(Worker):
    """While it is open, no connection of the session blocks the thread that closes it."""

    def __init__(self, session: zenoh.Session) -> None:
        super().__init__("prompt closing")
        self._session = session
        self._known: set[int] = set()  # inodes

    def _run(self) -> None:
        wake: Any = zenoh.handlers.Callback(lambda _: self.wake(), indirect=False)
        with self._session.info.declare_transport_events_listener(wake, history=True):
            while self._news.wait() and not self._stop.is_set():
                self._news.clear()
                self._known = set(self._sockets())
                self._stop.wait(PERIOD_S)

    def _sockets(self) -> Iterator[int]:
        """Clear `SO_LINGER` of all sockets that are not known yet. Yield the inodes of all."""
        for name in os.listdir(_FILES):
            with suppress(OSError):  # it may have been closed meanwhile
                status = os.fstat(int(name))
                if not stat.S_ISSOCK(status.st_mode):
                    continue
                if status.st_ino not in self._known:
                    _do_not_linger(int(name))
                yield status.st_ino


def _do_not_linger(file: int) -> None:
    connection = socket.socket(fileno=file)
    try:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _NO_LINGER)
    finally:
        connection.detach()  # it is Zenoh's

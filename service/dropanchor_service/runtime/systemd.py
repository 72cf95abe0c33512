"""What systemd is told of a service of Type=notify: that it is ready, that it makes progress, that it stops.

One datagram per message to the socket in NOTIFY_SOCKET (sd_notify(3)); without that variable nothing is sent.
"""

import os
import socket
from collections.abc import Mapping


class Systemd:
    """The service manager that started this process, if it was one."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        path = environment.get("NOTIFY_SOCKET")
        self._address = None if path is None else path.replace("@", "\0", 1) if path.startswith("@") else path

    def ready(self) -> None:
        self._tell("READY=1")

    def progress(self) -> None:
        """To be told well within WatchdogSec=, else the process is taken for stuck, killed and started again."""
        self._tell("WATCHDOG=1")

    def stopping(self) -> None:
        self._tell("STOPPING=1")

    def _tell(self, what: str) -> None:
        if self._address is None:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as to_manager:
            to_manager.setblocking(False)
            try:
                to_manager.sendto(what.encode(), self._address)
            except OSError:
                return  # nobody listens, or its queue is full: the next one will do

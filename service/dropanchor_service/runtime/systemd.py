"""Notify systemd that a service of Type=notify is ready, makes progress or stops.

Each notification is one datagram to the socket in NOTIFY_SOCKET, see sd_notify(3). Without that variable nothing is
sent.
"""

import os
import socket
from collections.abc import Mapping


class Systemd:
    """Sends notifications to the service manager, if one started this process."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        path = environment.get("NOTIFY_SOCKET")
        self._address = None if path is None else path.replace("@", "\0", 1) if path.startswith("@") else path

    def ready(self) -> None:
        """Notify that the service is ready."""
        self._notify("READY=1")

    def progress(self) -> None:
        """Notify the watchdog. Call this well within WatchdogSec=, or systemd kills and restarts the process."""
        self._notify("WATCHDOG=1")

    def stopping(self) -> None:
        """Notify that the service is stopping."""
        self._notify("STOPPING=1")

    def _notify(self, state: str) -> None:
        if self._address is None:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as to_manager:
            to_manager.setblocking(False)
            try:
                to_manager.sendto(state.encode(), self._address)
            except OSError:
                return  # no listener or a full queue: the next notification will do

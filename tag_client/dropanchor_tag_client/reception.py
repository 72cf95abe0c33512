"""Whether anybody receives what a tag sends. Zenoh drops in silence what nobody does, or what a router forbids."""

import time
from typing import Any

import zenoh

WHAT_TO_CHECK = "does the service run, and was the router restarted since `dropanchor tag add`?"
_WAIT_S, _POLL_S = 2.0, 0.02


class Reception:
    """Whether the router knows a subscriber of a key, and tells this client of it."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._publisher = session.declare_publisher(key)  # an advanced publisher does not know its match

    @property
    def has_subscriber(self) -> bool:
        status: Any = self._publisher.matching_status
        return bool(status.matching)

    def wait(self) -> bool:
        """Return whether there is a subscriber. The router says so soon after the connection."""
        give_up_s = time.monotonic() + _WAIT_S
        while not self.has_subscriber and time.monotonic() < give_up_s:
            time.sleep(_POLL_S)
        return self.has_subscriber

    def close(self) -> None:
        self._publisher.undeclare()

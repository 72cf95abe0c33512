"""Look after open clients beside their samples: report their health once a minute."""

import logging
import threading
import time
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Self

import zenoh

from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.health import HealthValues

PERIOD_S = 60.0
_POLL_S = 1.0

_log = logging.getLogger(__name__)


class Upkeep:
    """Report the health of clients while the block runs: `with TagClient("cart") as tag, Upkeep([tag]): …`.

    clients: open clients of one or many tags. values: returns what is known about the tags, by the names of
    `TagClient.publish_health`; each client adds what its spool holds. A client that is not connected yet reports as
    soon as it is.
    """

    def __init__(
        self,
        clients: Iterable[TagClient],
        values: Callable[[], HealthValues] = HealthValues,
        period_s: float = PERIOD_S,
    ) -> None:
        self._clients = clients
        self._values = values
        self._period_s = period_s
        self._due_s: dict[TagClient, float] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="upkeep", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.wait(min(_POLL_S, self._period_s)):
            now_s = time.monotonic()
            due = [client for client in list(self._clients) if self._due_s.get(client, 0.0) <= now_s]
            values = self._values() if due else HealthValues()
            for client in due:
                if client.session is not None:
                    self._due_s[client] = now_s + self._period_s
                    self._report(client, values)

    def _report(self, client: TagClient, values: HealthValues) -> None:
        try:
            client.publish_health(**values)
        except zenoh.ZError as error:
            _log.warning("tag %s: its health could not be sent: %s", client.tag, error)

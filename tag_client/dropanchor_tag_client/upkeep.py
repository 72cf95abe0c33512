"""Look after open clients beside their samples: report their health, and apply what the service sets for them."""

import logging
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Self

import zenoh

from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.health import HealthValues
from dropanchor_tag_client.reception import WHAT_TO_CHECK, Reception
from dropanchor_tag_client.reminders import Reminders
from dropanchor_tag_client.remote import RemoteSettings, parse

PERIOD_S = 60.0
_POLL_S = 1.0
_ANSWER_S = 5.0
_UNHEARD_S = 10.0  # a service that restarts is back by then
_NAMED = 5

_log = logging.getLogger(__name__)


class Upkeep:
    """Report the health of clients and follow their remote settings: `with TagClient("cart") as tag, Upkeep([tag]): …`.

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
        self._subscribers: dict[TagClient, Any] = {}
        self._replies: dict[TagClient, Any] = {}
        self._receptions: dict[TagClient, Reception] = {}
        self._heard_s = time.monotonic()
        self._reminders = Reminders()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="upkeep", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        for subscriber in self._subscribers.values():
            subscriber.undeclare()
        for reception in self._receptions.values():
            reception.close()

    def _run(self) -> None:
        while not self._stop.wait(min(_POLL_S, self._period_s)):
            for client in list(self._subscribers):
                for payload in self._received(client):
                    self._apply(client, payload)
            self._visit()
            self._look_for_silence()

    def _look_for_silence(self) -> None:
        """Warn of tags whose samples nobody receives. A spool keeps them, and says so itself."""
        unheard = [client.tag for client, one in self._receptions.items() if not one.has_subscriber]
        if not unheard:
            self._heard_s, self._reminders = time.monotonic(), Reminders()
        elif time.monotonic() - self._heard_s > _UNHEARD_S and self._reminders.failed():
            _log.warning("nobody receives the samples of %s: %s", ", ".join(unheard[:_NAMED]), WHAT_TO_CHECK)

    def _visit(self) -> None:
        now_s = time.monotonic()
        due = [client for client in list(self._clients) if self._due_s.get(client, 0.0) <= now_s]
        values = self._values() if due else HealthValues()
        for client in due:
            if client.session is not None:
                self._due_s[client] = now_s + self._period_s
                self._report(client, values)
                self._ask(client, client.session)

    def _ask(self, client: TagClient, session: zenoh.Session) -> None:
        """Ask for the settings of a tag, also after changes that it missed.

        Channels take the answers. Zenoh would run a callback on a thread of its own, and the process would abort if it
        ended before that thread.
        """
        key = client.keys.settings
        if client not in self._subscribers:
            self._subscribers[client] = session.declare_subscriber(key, zenoh.handlers.RingChannel(1))
            if client.spool_counts is None:
                self._receptions[client] = Reception(session, client.keys.samples)
        self._replies[client] = session.get(key, zenoh.handlers.DefaultHandler(), timeout=_ANSWER_S)

    def _received(self, client: TagClient) -> Iterator[bytes]:
        """Yield the settings that have arrived for a tag: the answers, then the newest change."""
        while (reply := _take(self._replies[client])) is not None:
            if reply.ok is not None:
                yield bytes(reply.ok.payload)
        if (change := _take(self._subscribers[client])) is not None:
            yield bytes(change.payload)

    def _apply(self, client: TagClient, payload: bytes) -> None:
        settings = parse(payload)
        if settings is None or settings == client.wanted:
            return
        if client.wanted is not None or settings != RemoteSettings():  # a service that sets nothing is not worth a line
            _log.info("tag %s: the service sets %s", client.tag, settings.in_words)
        client.apply(settings)
        self._report(client, HealthValues())

    def _report(self, client: TagClient, values: HealthValues) -> None:
        try:
            client.publish_health(**values)
        except zenoh.ZError as error:
            _log.warning("tag %s: its health could not be sent: %s", client.tag, error)


def _take(channel: Any) -> Any:
    """Return what waits in a channel, None if nothing does or it is closed."""
    try:
        return channel.try_recv()
    except zenoh.ZError:
        return None

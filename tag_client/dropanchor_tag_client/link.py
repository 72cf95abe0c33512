"""The connection of a spooling publisher: made in the background, and watched."""

import logging
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_tag_client.reception import Reception
from dropanchor_tag_client.reminders import Reminders
from dropanchor_tag_client.session import ConnectError, SessionSettings, open_session

LOST_LINK_S = 12.0  # by then, a link that was cut without a word is known to be down: Zenoh's lease is 10 s at most
_ATTEMPT_S = 1.0

_log = logging.getLogger(__name__)


class TagKeys(NamedTuple):
    """The keys of a tag: of its samples, its liveliness token, its pose, its health and its settings."""

    samples: str
    alive: str
    pose: str
    health: str
    settings: str

    @classmethod
    def of(cls, site: str, tag: str) -> Self:
        return cls(
            keys.samples_key(site, tag),
            keys.tag_alive_key(site, tag),
            keys.pose_key(site, tag),
            keys.health_key(site, tag),
            keys.settings_key(site, tag),
        )


class Link:
    """A session in which the tag is declared."""

    def __init__(
        self, session: zenoh.Session, tag_keys: TagKeys, declare: Callable[[zenoh.Session], Any], *, owned: bool
    ) -> None:
        self.session = session
        self._pose_key = tag_keys.pose
        self._owned = owned
        self._publisher = declare(session)
        self._reception = Reception(session, tag_keys.samples)
        self._token = session.liveliness().declare_token(tag_keys.alive)

    @property
    def has_subscriber(self) -> bool:
        """Return whether the router is connected and somebody subscribes to the samples."""
        return self._reception.has_subscriber

    def put(self, payload: bytes, encoding: str) -> None:
        self._publisher.put(payload, encoding=encoding)

    def delivery(self) -> Callable[[], bool]:
        """Return a function that tells whether the router has what was put before, or the link is down.

        A query follows the messages on their way, and the router ends it once it has passed them on.
        """
        replies: Any = self.session.get(self._pose_key, zenoh.handlers.DefaultHandler(), timeout=LOST_LINK_S)
        return partial(_is_closed, replies)

    def close(self) -> None:
        self._token.undeclare()
        self._reception.close()
        self._publisher.undeclare()
        if self._owned:
            self.session.close()


class Linker:
    """Connects in the background, because connecting blocks while the router is away."""

    def __init__(
        self,
        connect: SessionSettings | zenoh.Session,
        tag_keys: TagKeys,
        declare: Callable[[zenoh.Session], Any],
        on_linked: Callable[[], None],
    ) -> None:
        self._connect = connect
        self._tag_keys = tag_keys
        self._declare = declare
        self._on_linked = on_linked
        self._lock = threading.Lock()
        self._link: Link | None = None
        self._closed = False
        self._reminders = Reminders()
        self._thread = threading.Thread(target=self._run, name=f"connect {tag_keys.samples}", daemon=True)
        self._thread.start()

    @property
    def link(self) -> Link | None:
        return self._link

    def close(self) -> None:
        """Close the link. An attempt to connect that is under way ends within a second.

        The interpreter must not end before it: it would abort in the middle of the native call.
        """
        with self._lock:
            self._closed = True
            link, self._link = self._link, None
        self._thread.join()
        if link is not None:
            link.close()

    def _run(self) -> None:
        while not self._closed:
            session = self._session()
            if session is None:
                continue
            with self._lock:
                if not self._closed:
                    owned = isinstance(self._connect, SessionSettings)
                    self._link = Link(session, self._tag_keys, self._declare, owned=owned)
                    self._on_linked()
                    return
            session.close()

    def _session(self) -> zenoh.Session | None:
        if not isinstance(self._connect, SessionSettings):
            return self._connect
        try:
            return open_session(self._connect, _ATTEMPT_S)
        except ConnectError as error:
            if self._reminders.failed():
                _log.warning("%s %s; messages go to the spool.", error, self._reminders.words)
            return None


def _is_closed(channel: Any) -> bool:
    """Discard what waits in a channel. Return whether it is closed."""
    try:
        while channel.try_recv() is not None:
            pass
    except zenoh.ZError:
        return True
    return False

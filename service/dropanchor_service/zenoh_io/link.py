"""Keeps the Zenoh session of the service: opens its own router at once, or retries until an external one answers."""

import logging
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from typing import Self

import zenoh

from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.zenoh_io.router_watch import ANSWER_S, RouterWatch
from dropanchor_service.zenoh_io.session import ATTEMPT_S, ZenohError, open_session

RETRY_S = 0.2

_log = logging.getLogger(__name__)


class ZenohLink:
    """Opens a session, and then the parts that use it.

    Retries in the background while the router does not answer, and then watches whether it still does.
    watched: key of a token that this session may ask for. Entering raises ZenohError where a retry would not help.
    """

    def __init__(
        self,
        settings: ZenohSettings,
        parts: Callable[[zenoh.Session], list[AbstractContextManager[object]]],
        watched: str,
        credentials: SecurityFolder | None = None,
    ) -> None:
        self._settings = settings
        self._credentials = credentials
        self._parts = parts
        self._watched = watched
        self._opened = ExitStack()
        self._session: zenoh.Session | None = None
        self._watch: RouterWatch | None = None
        self._stop = threading.Event()
        # No daemon: Zenoh's threads for callbacks inherit that, and one that outlives Python aborts the process.
        self._thread = threading.Thread(target=self._connect, name="zenoh link")

    def __enter__(self) -> Self:
        if self._settings.connect:
            self._thread.start()
        else:
            self._open()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join(ATTEMPT_S + ANSWER_S)
        self._opened.close()

    @property
    def problem(self) -> str | None:
        """Why Zenoh cannot be used now; None when it can."""
        if self._session is None or (self._watch is not None and not self._watch.is_connected):
            return "there is no connection to the Zenoh router"
        return "the Zenoh router does not answer although it is connected" if self.is_deaf else None

    @property
    def is_deaf(self) -> bool:
        """Whether nothing comes over the connection any longer. Only another session helps."""
        return self._watch is not None and self._watch.is_deaf

    def _open(self) -> zenoh.Session:
        with ExitStack() as opening:
            session = opening.enter_context(open_session(self._settings, self._credentials))
            for part in self._parts(session):
                opening.enter_context(part)
            self._opened = opening.pop_all()
        self._session = session
        return session

    def _connect(self) -> None:
        has_warned = False
        while not self._stop.is_set():
            try:
                session = self._open()
            except ZenohError as error:
                if not has_warned:
                    _log.warning("%s The service keeps trying.", error)
                has_warned = True
                self._stop.wait(RETRY_S)
            else:
                _log.info("connected to the Zenoh router at %s", ", ".join(self._settings.connect))
                self._watch = RouterWatch(session, self._watched, self._stop)
                self._watch.run()

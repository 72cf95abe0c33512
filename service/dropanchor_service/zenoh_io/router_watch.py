"""Notice that the router of a client no longer answers although the connection to it is up.

Zenoh's keep-alives do not show that: its threads that pass on messages may be blocked on either side meanwhile.
"""

import logging
import threading

import zenoh

from dropanchor_service.zenoh_io.channel import drain

ANSWER_S = 2.0
PERIOD_S = 3.0
UNANSWERED = 3  # queries in a row; counted and not timed, since this process itself may have been suspended

_log = logging.getLogger(__name__)


class RouterWatch:
    """Asks for liveliness tokens now and then, until `stop` is set. The router answers even if there are none.

    key: of the tokens. A router that has never answered may forbid the query, so it is not taken for a dead one.
    """

    def __init__(self, session: zenoh.Session, key: str, stop: threading.Event) -> None:
        self._session = session
        self._key = key
        self._stop = stop
        self._has_answered = False
        self._unanswered = 0

    @property
    def is_connected(self) -> bool:
        return bool(self._session.info.routers_zid())

    @property
    def is_deaf(self) -> bool:
        """Whether the router does not answer although it is connected."""
        return self._unanswered >= UNANSWERED and self.is_connected

    def run(self) -> None:
        while not self._stop.wait(PERIOD_S):
            if not self.is_connected:
                self._unanswered = 0
            elif self._is_answered():
                self._has_answered, self._unanswered = True, 0
            elif self._has_answered:
                self._unanswered += 1
                _log.warning("the Zenoh router has not answered for %.0f s", ANSWER_S)

    def _is_answered(self) -> bool:
        replies = self._session.liveliness().get(self._key, zenoh.handlers.FifoChannel(1), timeout=ANSWER_S)
        return all(reply.err is None for reply in drain(replies))

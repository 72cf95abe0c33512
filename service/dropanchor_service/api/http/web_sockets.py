"""The WebSocket protocol of the server: uvicorn's, with two changes."""

import logging
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

MAX_MESSAGE_BYTES = 1_048_576


class GuardedWebSocket(WebSocketsSansIOProtocol):
    """Keeps the headers of a handshake out of the log, since they hold the key, and cuts a client that is gone."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.conn.debug = False
        self.logger = logging.getLogger(__name__)
        self.logger.setLevel(logging.WARNING)  # it logs the query at INFO

    def keepalive_timeout(self) -> None:
        """Disconnect a client that did not answer a ping. A clean end would wait until it reads again."""
        self.transport.abort()

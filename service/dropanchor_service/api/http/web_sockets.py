"""The WebSocket protocol of the server: uvicorn's, with four changes."""

import asyncio
import logging
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.protocol import State

from dropanchor_service.api.http.open_sockets import OpenSockets

MAX_MESSAGE_BYTES = 1_048_576


class GuardedWebSocket(WebSocketsSansIOProtocol):
    """Keeps the headers of a handshake out of the log, since they hold the key, and cuts a client that is gone.

    A connection that the service has ended counts as silent: its client may take long to answer, or never do.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.conn.debug = False
        self.logger = logging.getLogger(__name__)
        self.logger.setLevel(logging.WARNING)  # it logs the query at INFO
        self._sockets: OpenSockets | None = getattr(options.get("server_state"), "sockets", None)
        self._number = -1  # file descriptor

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self._number = transport.get_extra_info("socket").fileno()

    async def send(self, message: Any) -> None:
        await super().send(message)
        if self.close_sent and self._sockets is not None and not self.transport.is_closing():
            self._sockets.note_silent(self._number)

    def shutdown(self) -> None:
        """End the connection while the server stops. uvicorn's own raises when the client has just ended it."""
        if self.conn.state in (State.CLOSING, State.CLOSED):
            self.close_sent = True
        super().shutdown()

    def keepalive_timeout(self) -> None:
        """Disconnect a client that did not answer a ping. A clean end would wait until it reads again."""
        self.transport.abort()

"""Run the HTTP server in its own thread, so that the main thread can supervise and stop it."""

import asyncio
import logging
import socket
import ssl
import threading
import time
from typing import Any

from dropanchor_service.api.http.server import Server

HANDSHAKE_S = 10.0

_log = logging.getLogger(__name__)


class _Loop(asyncio.SelectorEventLoop):
    """Shortens the TLS handshake timeout. asyncio waits a minute, and uvicorn has no setting for it."""

    async def create_server(self, *args: Any, **options: Any) -> Any:
        handshake = {"ssl_handshake_timeout": HANDSHAKE_S} if options.get("ssl") else {}
        create: Any = super().create_server
        return await create(*args, **options, **handshake)


class HttpThread:
    """Serves on a socket that is already bound."""

    def __init__(self, server: Server, bound: socket.socket) -> None:
        self._server = server
        self._bound = bound
        self._thread = threading.Thread(target=self._run, name="http", daemon=True)

    def start(self) -> None:
        """Start the thread. Return when the server answers requests or has failed to start."""
        self._thread.start()
        while self.is_alive and not self._server.started:
            time.sleep(0.005)

    def ask_to_stop(self) -> None:
        """Tell the server to shut down, without waiting."""
        self._server.ask_to_stop()

    def reload_certificate(self) -> None:
        """Use the certificate as its files are now, for new connections. One that is unusable changes nothing."""
        config = self._server.config
        if config.ssl is None or config.ssl_certfile is None:
            return
        files = (config.ssl_certfile, config.ssl_keyfile)
        try:
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(*files)
            config.ssl.load_cert_chain(*files)
        except (OSError, ssl.SSLError) as error:
            _log.error("the certificate %s cannot be used (%s): the former one stays", config.ssl_certfile, error)
        else:
            _log.info("reloaded: the certificate %s", config.ssl_certfile)

    def join(self, timeout_s: float) -> None:
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        self._bound.close()

    @property
    def is_alive(self) -> bool:
        return self._thread.is_alive()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=_Loop) as runner:
            runner.run(self._server.serve(sockets=[self._bound]))

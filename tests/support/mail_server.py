"""A real SMTP server on loopback, in a thread of the test."""

import socket
import ssl
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from email import message_from_bytes
from email.message import EmailMessage
from email.policy import default
from typing import Any

from aiosmtpd.controller import Controller
from aiosmtpd.smtp import SMTP, AuthResult, Envelope, LoginPassword, Session

from support.zenoh_router import free_port, wait_until


@dataclass
class MailServer:
    """What came, in order of arrival, and when. answer: to every mail. refused: what recipients are answered with."""

    port: int = field(default_factory=free_port)
    answer: str = "250 OK"
    refused: dict[str, str] = field(default_factory=dict)
    login: tuple[str, str] | None = None
    mails: list[EmailMessage] = field(default_factory=list)
    arrived_s: list[float] = field(default_factory=list)
    attempts: int = 0
    was_encrypted: list[bool] = field(default_factory=list)

    async def handle_RCPT(  # noqa: N802, the name is the library's
        self, _server: SMTP, _session: Session, envelope: Envelope, address: str, _options: list[str]
    ) -> str:
        if address in self.refused:
            self.attempts += 1
            return self.refused[address]
        envelope.rcpt_tos.append(address)
        return "250 OK"

    async def handle_DATA(self, server: SMTP, _session: Session, envelope: Envelope) -> str:  # noqa: N802
        self.attempts += 1
        assert server.transport is not None
        self.was_encrypted.append(server.transport.get_extra_info("sslcontext") is not None)
        if self.answer.startswith("250"):
            assert isinstance(envelope.content, bytes)
            self.arrived_s.append(time.monotonic())
            self.mails.append(message_from_bytes(envelope.content, policy=default))
        return self.answer

    def authenticate(
        self, _server: SMTP, _session: Session, _envelope: Envelope, _mechanism: str, data: Any
    ) -> AuthResult:
        sent = (data.login.decode(), data.password.decode()) if isinstance(data, LoginPassword) else None
        return AuthResult(success=sent == self.login, handled=False)

    def text(self) -> str:
        """Return the bodies of all mails."""
        return "\n".join(mail.get_content() for mail in list(self.mails))


class _Listener(socket.socket):
    """A listening socket that knows the connections that it has accepted."""

    def __init__(self, port: int) -> None:
        super().__init__(socket.AF_INET, socket.SOCK_STREAM)
        self.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.bind(("127.0.0.1", port))
        self._accepted: list[socket.socket] = []

    def accept(self) -> tuple[socket.socket, Any]:
        connection, address = super().accept()
        self._accepted.append(connection)
        return connection, address

    def end_all(self) -> None:
        """End the connections, also in the midst of a TLS handshake, and wait until asyncio has closed them."""
        for connection in self._accepted:
            with suppress(OSError):  # it has ended
                connection.shutdown(socket.SHUT_RDWR)
        wait_until(lambda: all(connection.fileno() == -1 for connection in self._accepted))


class _Controller(Controller):
    """Serves on a socket that is already bound. A controller alone leaves connections open that use TLS."""

    def __init__(self, handler: MailServer, listener: _Listener, **options: Any) -> None:
        super().__init__(handler, hostname="127.0.0.1", port=handler.port, **options)
        self._listener = listener

    def _create_server(self) -> Any:
        return self.loop.create_server(self._factory_invoker, sock=self._listener, ssl=self.ssl_context)


@contextmanager
def running_mail_server(
    server: MailServer, tls: ssl.SSLContext | None = None, starttls: ssl.SSLContext | None = None
) -> Iterator[None]:
    """Serve until the block ends. tls: TLS from the first byte. starttls: TLS on request, and required."""
    listener = _Listener(server.port)
    controller = _Controller(
        server,
        listener,
        ssl_context=tls,
        tls_context=starttls,
        require_starttls=starttls is not None,
        authenticator=server.authenticate if server.login else None,
        auth_required=server.login is not None,
        auth_require_tls=starttls is not None,
        data_size_limit=100_000_000,
    )
    controller.start()
    try:
        yield
    finally:
        listener.end_all()
        controller.stop()

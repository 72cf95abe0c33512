"""A real SMTP server on loopback, in a thread of the test."""

import ssl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from email import message_from_bytes
from email.message import EmailMessage
from email.policy import default
from typing import Any

from aiosmtpd.controller import Controller
from aiosmtpd.smtp import SMTP, AuthResult, Envelope, LoginPassword, Session

from support.zenoh_router import free_port


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


@contextmanager
def running_mail_server(
    server: MailServer, tls: ssl.SSLContext | None = None, starttls: ssl.SSLContext | None = None
) -> Iterator[None]:
    """Serve until the block ends. tls: TLS from the first byte. starttls: TLS on request, and required."""
    controller = Controller(
        server,
        hostname="127.0.0.1",
        port=server.port,
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
        controller.stop()

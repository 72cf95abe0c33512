"""Deliver events by e-mail: all events that wait, in one mail."""

import asyncio
import hashlib
import socket
import ssl
from collections import Counter
from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, replace
from email.message import EmailMessage
from email.utils import formatdate
from zoneinfo import ZoneInfo

import aiosmtplib

from dropanchor_schemas.destinations import EmailDestination
from dropanchor_schemas.events import Event
from dropanchor_service.delivery.addresses import RefusedAddressError, connected
from dropanchor_service.delivery.channel import ChannelError, Outcome, Portion, Verdict, password_in
from dropanchor_service.delivery.public_addresses import Network
from dropanchor_service.delivery.sentences import NameOf, ZoneOf, kind, link, place_and_time, sentence, site_of
from dropanchor_service.delivery.words import Words, words_in
from dropanchor_service.settings.events import EmailSettings

MAX_EVENTS = 10_000  # in one mail, which is then about 1 MB
LINKED = 20  # events in a mail that get a link each
_PORTS = {"starttls": 587, "tls": 465, "none": 25}
_PERMANENT = 500
_END_S = 1.0  # until asyncio has closed a connection that has ended


@dataclass(frozen=True)
class MailChannel:
    """Sends mails through the server of the settings. page: URL for the links, None: there are none."""

    destination: EmailDestination
    settings: EmailSettings
    tls: ssl.SSLContext
    timeout_s: float
    allow_networks: Iterable[Network]
    page: str | None
    name_of: NameOf
    zone_of: ZoneOf

    @property
    def portion(self) -> Portion:
        return Portion(MAX_EVENTS, is_mixed=True, pause_s=self.destination.digest_s)

    async def send(self, events: Sequence[bytes]) -> Sequence[Outcome]:
        zone = self.zone_of()
        words = replace(words_in(self.destination.language), zone=ZoneInfo(zone) if zone else None)
        mail = mail_of(events, self.settings.sender, self.destination.to, self.page, self.name_of, words)
        outcome = await self._send(mail)
        return [outcome] * len(events)

    async def _send(self, mail: EmailMessage) -> Outcome:
        try:
            refused, answer = await self._submit(mail)
        except aiosmtplib.SMTPAuthenticationError as error:
            return Outcome(Verdict.UNAVAILABLE, f"the mail server refuses the login: {error.code} {error.message}")
        except aiosmtplib.SMTPRecipientsRefused as error:
            return _refused_by(max(one.code for one in error.recipients), _reasons(error))
        except aiosmtplib.SMTPResponseException as error:
            return _refused_by(error.code, error.message)
        except (aiosmtplib.SMTPException, OSError, ChannelError, RefusedAddressError) as error:
            return Outcome(Verdict.UNAVAILABLE, f"the mail server cannot be used: {error or type(error).__name__}")
        warning = "; ".join(f"{address} was refused: {one.code} {one.message}" for address, one in refused.items())
        return Outcome(Verdict.ACCEPTED, f"the mail server answered: {answer}", warning or None)

    async def _submit(self, mail: EmailMessage) -> tuple[dict[str, aiosmtplib.SMTPResponse], str]:
        file, server = self.settings.password_file, self.settings.server or ""
        port = self.settings.port or _PORTS[self.settings.tls]
        async with asyncio.timeout(self.timeout_s):
            sock = await connected(server, port, self.allow_networks)
        try:
            return await aiosmtplib.send(
                mail,
                hostname=server,
                sock=sock,
                username=self.settings.user,
                password=None if file is None else password_in(file),
                timeout=self.timeout_s,
                use_tls=self.settings.tls == "tls",
                start_tls=self.settings.tls == "starttls",
                tls_context=None if self.settings.tls == "none" else self.tls,
            )
        finally:
            await _end(sock)


@asynccontextmanager
async def open_mail(
    destination: EmailDestination,
    settings: EmailSettings,
    tls: ssl.SSLContext,
    timeout_s: float,
    allow_networks: Iterable[Network],
    page: str | None,
    name_of: NameOf,
    zone_of: ZoneOf,
) -> AsyncIterator[MailChannel]:
    """Open the way to people. Every mail makes a connection of its own, since mails are rare."""
    yield MailChannel(destination, settings, tls, timeout_s, allow_networks, page, name_of, zone_of)


async def _end(sock: socket.socket) -> None:
    """End a connection. With TLS, asyncio would wait for the server to end it too, and the loop may end before."""
    with suppress(OSError):  # it has ended
        sock.shutdown(socket.SHUT_RDWR)
    with suppress(TimeoutError):
        async with asyncio.timeout(_END_S):
            while sock.fileno() != -1:
                await asyncio.sleep(0.005)
    sock.close()  # if nothing took it over


def mail_of(
    events: Sequence[bytes], sender: str, to: Sequence[str], page: str | None, name_of: NameOf, words: Words
) -> EmailMessage:
    """Return the mail about these events. The same events make the same `Message-ID`, so that doubles are known."""
    parsed = [Event.model_validate_json(event) for event in events]
    ids = hashlib.sha256(" ".join(event.id for event in parsed).encode()).hexdigest()[:32]
    mail = EmailMessage()
    mail["Subject"] = _subject(parsed, name_of, words)
    mail["From"] = sender
    mail["To"] = ", ".join(to)
    mail["Date"] = formatdate()
    mail["Message-ID"] = f"<{ids}@{sender.rpartition('@')[2]}>"
    mail["Auto-Submitted"] = "auto-generated"
    mail.set_content(_text(parsed, page, name_of, words))
    return mail


def _subject(events: Sequence[Event], name_of: NameOf, words: Words) -> str:
    more = ", " + words.texts["mail.more"].format(count=words.number(len(events) - 1, 0)) if len(events) > 1 else ""
    return f"[{site_of(events[0])}] {sentence(events[0], name_of, words)}{more}"


def _text(events: Sequence[Event], page: str | None, name_of: NameOf, words: Words) -> str:
    linked = page if len(events) <= LINKED else None
    parts = [_summary(events, words)] if len(events) > LINKED else []
    parts += [_paragraph(event, linked, name_of, words) for event in events]
    if page is not None and linked is None:
        parts.append(f"{words.texts['mail.page']} {page}")
    return "\n\n".join(parts) + "\n"


def _summary(events: Sequence[Event], words: Words) -> str:
    counts = Counter(kind(event, words) for event in events).most_common()
    counted = [f"{words.number(count, 0)} x {text}" for text, count in counts]
    return "\n".join([words.texts["mail.events"].format(count=words.number(len(events), 0)), *counted])


def _paragraph(event: Event, page: str | None, name_of: NameOf, words: Words) -> str:
    lines = [
        f"{sentence(event, name_of, words)}.",
        f"{place_and_time(event, words)}; {words.texts['mail.event']} {int(event.sequence)}",
    ]
    return "\n".join([*lines, link(page, event)] if page is not None else lines)


def _reasons(error: aiosmtplib.SMTPRecipientsRefused) -> str:
    return "; ".join(f"{one.recipient}: {one.message}" for one in error.recipients)


def _refused_by(code: int, message: str) -> Outcome:
    verdict = Verdict.REFUSED if code >= _PERMANENT else Verdict.UNAVAILABLE
    return Outcome(verdict, f"the mail server answered {code} {message}")

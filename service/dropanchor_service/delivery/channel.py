"""What all ways to a destination have in common."""

import ssl
from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import NamedTuple, Protocol

from dropanchor_schemas.sentences import said_by, say


class ChannelError(ValueError):
    """Nothing can be delivered to this destination. The message says what to do.

    network: the network that the page can allow, after which something can; None: that is not what is wrong.
    """

    def __init__(self, message: str, network: str | None = None) -> None:
        super().__init__(message)
        self.network = network


class Verdict(Enum):
    """What became of an event. REFUSED is about this event; UNAVAILABLE is about the receiver."""

    ACCEPTED = 0
    REFUSED = 1
    UNAVAILABLE = 2


class Outcome(NamedTuple):
    """detail: what the receiver answered. warning: what a person should mend although the event was accepted."""

    verdict: Verdict
    detail: str
    warning: str | None = None


class Portion(NamedTuple):
    """How events leave a queue.

    size: most events at once. is_mixed: whether one portion may hold several events of a tag. pause_s: least time
    between two portions.
    """

    size: int
    is_mixed: bool = False
    pause_s: float = 0.0


class Channel(Protocol):
    """An open way to one destination."""

    @property
    def portion(self) -> Portion: ...

    async def send(self, events: Sequence[bytes]) -> Sequence[Outcome]:
        """Send events, each a CloudEvent in JSON, within a time limit. Return the outcome of each."""


def tls_context(authorities: Path | None) -> ssl.SSLContext:
    """Return a context that trusts the public authorities and those in the PEM file. Raises OSError."""
    import httpx  # 4 MB of memory, only where something is delivered

    context = httpx.create_ssl_context(trust_env=False)
    if authorities is not None:
        context.load_verify_locations(authorities)
    return context


def password_in(file: Path) -> str:
    """Return the password in a file. Raises ChannelError."""
    try:
        return file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ChannelError(
            say("password_file", "the password file {file} cannot be read: {why}", file=file, why=said_by(error))
        ) from error

"""Who asks over REST, and what they may do."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol, Self


class Scope(IntEnum):
    """What somebody may do; each includes those before it."""

    READ = 1
    WRITE = 2
    ADMIN = 3

    @classmethod
    def named(cls, name: str) -> Self:
        """Raises KeyError."""
        return cls[name.upper()]

    @property
    def word(self) -> str:
        return self.name.lower()


SCOPES = tuple(scope.word for scope in Scope)


@dataclass(frozen=True)
class Identity:
    """source: where it is known from. expires_s: seconds since 1970, None: never."""

    source: str
    name: str
    scope: Scope | None
    expires_s: float | None = None


class UnauthenticatedError(Exception):
    """Nobody is known by what was shown; the message may be told to whoever asks."""


class IdentityProvider(Protocol):
    """One place where somebody may be known."""

    takes_time: bool
    """Whether `identify` may ask somebody else, so that it has no place on an event loop."""

    def knows(self, secret: str) -> bool:
        """Whether it looks like one of ours."""

    def identify(self, secret: str) -> Identity:
        """Raises UnauthenticatedError."""

    def is_still_good(self, identity: Identity) -> bool:
        """Whether the identity it once gave still holds. At once."""


class Authenticator:
    """Knows which register to ask. providers: by the source that their identities name."""

    def __init__(self, providers: Mapping[str, IdentityProvider]) -> None:
        self._providers = dict(providers)

    def provider_of(self, secret: str) -> IdentityProvider:
        """Raises UnauthenticatedError."""
        for register in self._providers.values():
            if register.knows(secret):
                return register
        raise UnauthenticatedError("what was sent is neither an API key nor a token that this service takes")

    def is_still_good(self, identity: Identity) -> bool:
        return self._providers[identity.source].is_still_good(identity)

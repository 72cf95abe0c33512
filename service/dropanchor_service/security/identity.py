"""The identity and scope of REST clients."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol, Self

from dropanchor_schemas.sentences import say


class Scope(IntEnum):
    """A permission level; each includes the lower ones."""

    READ = 1
    WRITE = 2
    ADMIN = 3

    @classmethod
    def named(cls, name: str) -> Self:
        """Return the scope with this lower-case name. Raises KeyError."""
        return cls[name.upper()]

    @property
    def word(self) -> str:
        return self.name.lower()


SCOPES = tuple(scope.word for scope in Scope)


@dataclass(frozen=True)
class Limit:
    """The only tags that a client may read: one tag, or those of a group."""

    tag: str | None
    group: str | None


@dataclass(frozen=True)
class Identity:
    """An authenticated client.

    source: the identity provider. scope: what the client may do in every site; None: nothing. expires_s: Unix time;
    None: never. tag: the tag whose samples the client may send; None: no tag. limit: the only tags that it may read;
    None: all. site: that of `tag`; None: the only one. of_sites: what the client may do in single sites. key: the id of
    its API key, which another key of the same name does not have.
    """

    source: str
    name: str
    scope: Scope | None
    expires_s: float | None = None
    tag: str | None = None
    limit: Limit | None = None
    site: str | None = None
    of_sites: Mapping[str, Scope] = field(default_factory=dict)
    key: str | None = None

    def scope_in(self, site: str | None) -> Scope | None:
        """Return what the client may do in a site; None: nothing. site: None for what concerns all sites."""
        own = None if site is None else self.of_sites.get(site)
        return max((scope for scope in (self.scope, own) if scope is not None), default=None)


class UnauthenticatedError(Exception):
    """The credentials are not valid. The message is safe to return to the client."""


class IdentityProvider(Protocol):
    """A source of identities, such as API keys or an OpenID Connect provider."""

    may_block: bool
    """Whether `identify` may wait for the network, so that it must not run on an event loop."""

    def recognises(self, secret: str) -> bool:
        """Return whether the secret has the form that this provider issues."""

    def identify(self, secret: str) -> Identity:
        """Return the identity that the secret belongs to. Raises UnauthenticatedError."""

    def is_still_valid(self, identity: Identity) -> bool:
        """Return whether an identity of this provider is neither revoked nor expired. Never blocks."""


class Authenticator:
    """Selects the identity provider for a secret. providers: by the `source` of their identities."""

    def __init__(self, providers: Mapping[str, IdentityProvider]) -> None:
        self._providers = dict(providers)

    def provider(self, source: str) -> IdentityProvider | None:
        """Return the provider of this source, None when there is none."""
        return self._providers.get(source)

    def provider_of(self, secret: str) -> IdentityProvider:
        """Return the provider that recognises the secret. Raises UnauthenticatedError when none does."""
        for provider in self._providers.values():
            if provider.recognises(secret):
                return provider
        raise UnauthenticatedError(
            say("why_no_credential", "the credential is neither an API key nor a token that this service accepts")
        )

    def is_still_valid(self, identity: Identity) -> bool:
        return self._providers[identity.source].is_still_valid(identity)

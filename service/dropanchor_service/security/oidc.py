"""Bearer tokens of an OpenID Connect provider: JWTs (RFC 9068) that its published keys (JWKS) have signed."""

import logging
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import jwt

from dropanchor_service.security.identity import Identity, Scope, UnauthenticatedError
from dropanchor_service.settings.model import OidcSettings, is_safe_url

SOURCE = "token"
ALGORITHMS = ("RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA")
LEEWAY_S = 30.0
REFRESH_S = 300.0
RETRY_S = 10.0  # whatever tokens say, the provider is asked no more often
_TIMEOUT_S = 5.0

_log = logging.getLogger(__name__)


class OidcTokens:
    """Verifies signature, issuer, audience and times, and maps the token's scopes to ours."""

    takes_time = True

    def __init__(self, settings: OidcSettings) -> None:
        self._settings = settings
        self._keys = SigningKeys(settings.issuer, settings.jwks_url)

    def knows(self, secret: str) -> bool:
        return secret.count(".") == 2

    def identify(self, secret: str) -> Identity:
        """Raises UnauthenticatedError. Asks the provider for its keys when they are needed."""
        try:
            header = jwt.get_unverified_header(secret)
            if header.get("alg") not in ALGORITHMS:
                raise UnauthenticatedError("the token is not signed by an algorithm that is taken here")
            claims = jwt.decode(
                secret,
                self._keys.find(header.get("kid")),
                algorithms=ALGORITHMS,
                audience=self._settings.audience,
                issuer=self._settings.issuer,
                leeway=LEEWAY_S,
                options={"require": ["exp", "iss", "aud"]},
            )
        except jwt.PyJWTError as error:
            raise UnauthenticatedError(f"the token is not valid: {error}") from error
        name = str(claims.get("sub") or claims.get("client_id") or "a token without a subject")
        return Identity(SOURCE, name, self._scope(claims), float(claims["exp"]))

    def is_still_good(self, identity: Identity) -> bool:
        return identity.expires_s is None or time.time() < identity.expires_s + LEEWAY_S

    def _scope(self, claims: Mapping[str, Any]) -> Scope | None:
        """The highest that the token has."""
        value: Any = claims
        for part in self._settings.scope_claim.split("."):
            value = value.get(part) if isinstance(value, Mapping) else None
        told = set(value.split() if isinstance(value, str) else value if isinstance(value, list) else [])
        ours = [Scope.named(name) for name, theirs in self._settings.scopes.items() if theirs in told]
        return max(ours, default=None)


class SigningKeys:
    """The provider's keys, fetched again after a while or when a token names one that is not known.

    PyJWKClient fetches and checks them. When to fetch stays here: that client waits under one lock for a provider that
    hangs, asks a provider that fails again for every token, and forgets its keys when they are due.
    """

    def __init__(self, issuer: str, jwks_url: str | None, clock: Callable[[], float] = time.monotonic) -> None:
        self._issuer = issuer
        self._jwks_url = jwks_url
        self._clock = clock
        self._lock = threading.Lock()
        self._keys: dict[str | None, jwt.PyJWK] = {}
        self._fetched_s = self._tried_s = -float("inf")

    def find(self, kid: str | None) -> jwt.PyJWK:
        """Return the key of this id. Raises UnauthenticatedError."""
        if kid not in self._keys or self._clock() - self._fetched_s > REFRESH_S:
            self._refresh()
        if kid not in self._keys:
            why = "that its issuer does not publish" if self._keys else "of an issuer that does not answer"
            raise UnauthenticatedError(f"the token is signed with a key {why}")
        return self._keys[kid]

    def _refresh(self) -> None:
        """Fetch the keys, unless another thread is fetching them; wait for that thread only if no key is known yet."""
        if not self._lock.acquire(timeout=0 if self._keys else _TIMEOUT_S):
            return
        try:
            if self._clock() - self._tried_s >= RETRY_S:
                self._tried_s = self._clock()
                keys = _client(self._jwks_url or self._discovered()).get_jwk_set().keys
                self._keys = {key.key_id: key for key in keys}
                self._fetched_s = self._clock()
        except (OSError, ValueError, jwt.PyJWTError) as error:
            _log.warning("the keys of %s cannot be had: %s", self._issuer, error)
        finally:
            self._lock.release()

    def _discovered(self) -> str:
        """The address of the keys, as the issuer's metadata tells it (OpenID Connect Discovery 1.0, section 4)."""
        metadata = _client(f"{self._issuer.rstrip('/')}/.well-known/openid-configuration").fetch_data()
        return str(metadata.get("jwks_uri"))


def _client(url: str) -> jwt.PyJWKClient:
    """A client that follows no redirect and keeps nothing. Raises ValueError unless the address is safe."""
    return jwt.PyJWKClient(is_safe_url(url), cache_jwk_set=False, timeout=_TIMEOUT_S)

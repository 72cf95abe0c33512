"""Bearer tokens of an OpenID Connect provider: JWTs (RFC 9068), verified with the keys it publishes (JWKS)."""

import logging
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import jwt

from dropanchor_schemas.sentences import say
from dropanchor_service.security.identity import Identity, Scope, UnauthenticatedError
from dropanchor_service.settings.model import OidcSettings, is_safe_url
from dropanchor_service.settings.sites import ScopeName

SOURCE = say("source_token", "token")
ALGORITHMS = ("RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA")
LEEWAY_S = 30.0
REFRESH_S = 300.0
RETRY_S = 10.0  # the shortest time between two requests to the provider, whatever key ids tokens name
_TIMEOUT_S = 5.0

_log = logging.getLogger(__name__)


class OidcTokens:
    """Verifies signature, issuer, audience and times of a token, and maps its scopes to those of the service.

    of_sites: for each site the provider's names of our scopes in this site alone.
    """

    may_block = True

    def __init__(self, settings: OidcSettings, of_sites: Mapping[str, Mapping[ScopeName, str]] | None = None) -> None:
        self._settings = settings
        self._of_sites = of_sites or {}
        self._keys = SigningKeys(settings.issuer, settings.jwks_url)

    def recognises(self, secret: str) -> bool:
        return secret.count(".") == 2

    def identify(self, secret: str) -> Identity:
        """Return the identity in a token. Fetches the provider's keys when needed. Raises UnauthenticatedError."""
        try:
            claims = self._verified(secret)
            expires_s = float(claims["exp"])
        except jwt.PyJWTError as error:
            raise UnauthenticatedError(f"the token is not valid: {error}") from error
        except (ValueError, TypeError, OverflowError, RecursionError) as error:  # PyJWT expects numbers where times are
            raise UnauthenticatedError("the token is not valid: a claim has a value that it cannot have") from error
        name = str(claims.get("sub") or claims.get("client_id") or "a token without a subject")
        granted = self._granted(claims)
        in_sites = ((site, _highest(names, granted)) for site, names in self._of_sites.items())
        of_sites = {site: scope for site, scope in in_sites if scope is not None}
        return Identity(SOURCE, name, _highest(self._settings.scopes, granted), expires_s, of_sites=of_sites)

    def _verified(self, secret: str) -> Mapping[str, Any]:
        """Return the claims of a token. Raises UnauthenticatedError, and what PyJWT raises."""
        header = jwt.get_unverified_header(secret)
        if header.get("alg") not in ALGORITHMS:
            raise UnauthenticatedError("the token is not signed with an accepted algorithm")
        return jwt.decode(
            secret,
            self._keys.find(header.get("kid")),
            algorithms=ALGORITHMS,
            audience=self._settings.audience,
            issuer=self._settings.issuer,
            leeway=LEEWAY_S,
            options={"require": ["exp", "iss", "aud"]},
        )

    def is_still_valid(self, identity: Identity) -> bool:
        return identity.expires_s is None or time.time() < identity.expires_s + LEEWAY_S

    def _granted(self, claims: Mapping[str, Any]) -> set[str]:
        """Return the provider's names of the scopes that the claims grant. What is no text grants nothing."""
        value: Any = claims
        for part in self._settings.scope_claim.split("."):
            value = value.get(part) if isinstance(value, Mapping) else None
        listed = value.split() if isinstance(value, str) else value if isinstance(value, list) else []
        return {name for name in listed if isinstance(name, str)}


def _highest(names: Mapping[ScopeName, str], granted: set[str]) -> Scope | None:
    """Return the highest scope that is granted; None when none is. names: those of the provider."""
    return max((Scope.named(name) for name, theirs in names.items() if theirs in granted), default=None)


class SigningKeys:
    """The provider's keys. They are fetched again periodically, and when a token names an unknown key.

    PyJWKClient fetches and checks the keys. This class decides when: PyJWKClient holds one lock while a provider hangs,
    asks a failing provider again for every token, and discards its keys when they are due for a refresh.
    """

    def __init__(self, issuer: str, jwks_url: str | None, clock: Callable[[], float] = time.monotonic) -> None:
        self._issuer = issuer
        self._jwks_url = jwks_url
        self._clock = clock
        self._lock = threading.Lock()
        self._keys: dict[str | None, jwt.PyJWK] = {}
        self._fetched_s = self._tried_s = -float("inf")

    def find(self, kid: str | None) -> jwt.PyJWK:
        """Return the key with this id; for a token that names none, the only one. Raises UnauthenticatedError."""
        if self._key(kid) is None or self._clock() - self._fetched_s > REFRESH_S:
            self._refresh()
        key = self._key(kid)
        if key is None and kid is None and self._keys:
            raise UnauthenticatedError("the token does not name its key (kid), and its issuer publishes several")
        if key is None:
            reason = "that its issuer does not publish" if self._keys else "of an issuer that does not answer"
            raise UnauthenticatedError(f"the token is signed with a key {reason}")
        return key

    def _key(self, kid: str | None) -> jwt.PyJWK | None:
        keys = self._keys
        return next(iter(keys.values())) if kid is None and len(keys) == 1 else keys.get(kid)

    def _refresh(self) -> None:
        """Fetch the keys, unless another thread does. Wait for that thread only while there are no keys."""
        if not self._lock.acquire(timeout=0 if self._keys else _TIMEOUT_S):
            return
        try:
            if self._clock() - self._tried_s >= RETRY_S:
                self._tried_s = self._clock()
                keys = _client(self._jwks_url or self._discovered()).get_jwk_set().keys
                self._keys = {key.key_id: key for key in keys}
                self._fetched_s = self._clock()
        except (OSError, ValueError, jwt.PyJWTError) as error:
            _log.warning("cannot fetch the keys of %s: %s; check security.oidc and the network", self._issuer, error)
        finally:
            self._lock.release()

    def _discovered(self) -> str:
        """Return the address of the keys from the issuer's metadata (OpenID Connect Discovery 1.0, section 4)."""
        metadata = _client(f"{self._issuer.rstrip('/')}/.well-known/openid-configuration").fetch_data()
        return str(metadata.get("jwks_uri"))


def _client(url: str) -> jwt.PyJWKClient:
    """Return a client that follows no redirects and caches nothing. Raises ValueError unless the address is safe."""
    return jwt.PyJWKClient(is_safe_url(url), cache_jwk_set=False, timeout=_TIMEOUT_S)

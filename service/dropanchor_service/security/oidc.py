"""Bearer tokens of an OpenID Connect provider: JWTs (RFC 9068) that its published keys (JWKS) have signed."""

import json
import logging
import threading
import time
import urllib.request
from collections.abc import Callable, Mapping
from typing import Any

import jwt

from dropanchor_service.security.identity import Identity, Scope, UnknownError
from dropanchor_service.settings.model import OidcSettings, is_safe_url

SOURCE = "token"
ALGORITHMS = ("RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA")
LEEWAY_S = 30.0
REFRESH_S = 300.0
RETRY_S = 10.0  # whatever tokens say, the provider is asked no more often
_TIMEOUT_S = 5.0
_MAX_ANSWER_BYTES = 1_000_000

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
        """Raises UnknownError. Asks the provider for its keys when they are needed."""
        try:
            header = jwt.get_unverified_header(secret)
            if header.get("alg") not in ALGORITHMS:
                raise UnknownError("the token is not signed by an algorithm that is taken here")
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
            raise UnknownError(f"the token is not valid: {error}") from error
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
    """The provider's keys, asked for again after a while or when a token names one that is not known."""

    def __init__(self, issuer: str, jwks_url: str | None, clock: Callable[[], float] = time.monotonic) -> None:
        self._issuer = issuer
        self._jwks_url = jwks_url
        self._clock = clock
        self._lock = threading.Lock()
        self._keys: dict[str | None, jwt.PyJWK] = {}
        self._fetched_s = self._tried_s = -float("inf")

    def find(self, kid: str | None) -> jwt.PyJWK:
        """Raises UnknownError."""
        if kid not in self._keys or self._clock() - self._fetched_s > REFRESH_S:
            self._refresh()
        if kid not in self._keys:
            why = "that its issuer does not publish" if self._keys else "of an issuer that does not answer"
            raise UnknownError(f"the token is signed with a key {why}")
        return self._keys[kid]

    def _refresh(self) -> None:
        """Whoever comes while somebody else is asking already does not wait, unless nothing is known yet."""
        if not self._lock.acquire(timeout=0 if self._keys else _TIMEOUT_S):
            return
        try:
            if self._clock() - self._tried_s >= RETRY_S:
                self._tried_s = self._clock()
                self._keys = {key.key_id: key for key in jwt.PyJWKSet.from_dict(self._document()).keys}
                self._fetched_s = self._clock()
        except (OSError, ValueError, jwt.PyJWTError) as error:
            _log.warning("the keys of %s cannot be had: %s", self._issuer, error)
        finally:
            self._lock.release()

    def _document(self) -> dict[str, Any]:
        url = self._jwks_url
        if url is None:
            url = str(_got(f"{self._issuer.rstrip('/')}/.well-known/openid-configuration").get("jwks_uri"))
        return _got(is_safe_url(url))


def _got(url: str) -> dict[str, Any]:
    with urllib.request.urlopen(url, timeout=_TIMEOUT_S) as answer:
        document = json.loads(answer.read(_MAX_ANSWER_BYTES))
    if not isinstance(document, dict):
        raise ValueError(f"{url} did not answer with an object")
    return document

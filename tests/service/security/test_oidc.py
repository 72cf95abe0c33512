"""OpenID Connect tokens, with a real provider on loopback."""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Thread
from typing import Any

import jwt
import pytest
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from fastapi import FastAPI
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from dropanchor_service.security.identity import Authenticator, Scope, UnauthenticatedError
from dropanchor_service.security.oidc import RETRY_S, SOURCE, OidcTokens, SigningKeys
from dropanchor_service.settings.model import OidcSettings
from dropanchor_service.settings.sites import ScopeName
from support.api import ask, make_api_bench
from support.patience import PATIENCE_S

AUDIENCE = "dropanchor-yard"


@cache  # a key takes longer to make than a test to run; each name has its own
def _key_named(_kid: str) -> rsa.RSAPrivateKey:
    return rsa.generate_private_key(65537, 2048)


@dataclass
class Provider:
    """Signs tokens and publishes its keys. requested: the requested paths; moved_to: redirects every request there."""

    url: str = ""
    keys: dict[str, Any] = field(default_factory=dict)
    requested: list[str] = field(default_factory=list)
    moved_to: str = ""

    def new_key(self, kid: str) -> None:
        self.keys[kid] = _key_named(kid)

    def answer(self, path: str) -> dict[str, Any]:
        self.requested.append(path)
        if path == "/.well-known/openid-configuration":
            return {"issuer": self.url, "jwks_uri": f"{self.url}/keys"}
        to_jwk = jwt.algorithms.RSAAlgorithm.to_jwk
        return {"keys": [to_jwk(key.public_key(), as_dict=True) | {"kid": kid} for kid, key in self.keys.items()]}

    def token(self, kid: str | None = "one", key: Any = None, algorithm: str = "RS256", **claims: Any) -> str:
        all_claims = {
            "iss": self.url,
            "aud": AUDIENCE,
            "sub": "ann",
            "exp": time.time() + 60,
            "scope": "dropanchor:read",
        }
        all_claims = {name: value for name, value in (all_claims | claims).items() if value is not None}
        signing = key or self.keys[kid or "one"]
        return jwt.encode(all_claims, signing, algorithm=algorithm, headers={} if kid is None else {"kid": kid})

    def token_with(self, claims: dict[str, Any]) -> str:
        """Return a signed token whose claims may be anything that JSON can hold, and more than PyJWT would encode."""
        body = {"iss": self.url, "aud": AUDIENCE, "sub": "ann", "exp": time.time() + 60} | claims
        return jwt.api_jws.encode(json.dumps(body).encode(), self.keys["one"], "RS256", {"kid": "one"})

    def settings(self, **more: Any) -> OidcSettings:
        return OidcSettings.model_validate({"issuer": self.url, "audience": AUDIENCE} | more)


@pytest.fixture
def provider() -> Iterator[Provider]:
    found = Provider()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            body = json.dumps(found.answer(self.path)).encode()
            self.send_response(302 if found.moved_to else 200)
            if found.moved_to:
                self.send_header("location", found.moved_to)
            self.send_header("content-length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        found.url = f"http://127.0.0.1:{server.server_port}"
        found.new_key("one")
        yield found
        server.shutdown()
        thread.join()


@pytest.fixture
def guarded(provider: Provider) -> FastAPI:
    """Return an interface that takes tokens whose roles, in an object, are the scopes."""
    tokens = OidcTokens(provider.settings(scope_claim="realm_access.roles", scopes={"write": "crew"}))
    return make_api_bench().app(authenticator=Authenticator({SOURCE: tokens}))


def test_a_token_of_the_provider_yields_its_subject_and_scope(provider: Provider) -> None:
    tokens = OidcTokens(provider.settings())
    identity = tokens.identify(provider.token(scope="openid dropanchor:read dropanchor:write"))
    assert (identity.source, identity.name, identity.scope) == ("token", "ann", Scope.WRITE)
    assert tokens.is_still_valid(identity)
    tokens.identify(provider.token())
    assert provider.requested == ["/.well-known/openid-configuration", "/keys"]


@pytest.mark.parametrize(
    ("more", "claims", "scope"),
    [
        ({}, {"scope": "profile"}, None),
        ({}, {"scope": None}, None),
        ({}, {"scope": "dropanchor:read"}, Scope.READ),
        ({}, {"scope": ["dropanchor:admin"]}, Scope.ADMIN),
        ({"scope_claim": "realm_access.roles", "scopes": {"write": "crew"}}, {"realm_access": {"roles": ["crew"]}}, 2),
        ({"scope_claim": "realm_access.roles"}, {"realm_access": "crew"}, None),
    ],
)
def test_scopes_are_mapped_as_the_settings_say(
    provider: Provider, more: dict[str, Any], claims: dict[str, Any], scope: Scope | None
) -> None:
    assert OidcTokens(provider.settings(**more)).identify(provider.token(**claims)).scope == scope


def test_scopes_of_single_sites_hold_in_these_alone(provider: Provider) -> None:
    names: dict[str, dict[ScopeName, str]] = {"a": {"write": "yard-a"}, "b": {"read": "yard-b", "admin": "boss"}}
    tokens = OidcTokens(provider.settings(), names)
    identity = tokens.identify(provider.token(scope="yard-a yard-b boss"))
    assert [identity.scope_in(site) for site in ("a", "b", "c", None)] == [Scope.WRITE, Scope.ADMIN, None, None]
    everywhere = tokens.identify(provider.token(scope="dropanchor:read yard-a"))
    assert [everywhere.scope_in(site) for site in ("a", "b", None)] == [Scope.WRITE, Scope.READ, Scope.READ]


@pytest.mark.parametrize(
    ("claims", "words"),
    [
        ({"exp": 1}, "expired"),
        ({"exp": None}, "exp"),
        ({"nbf": 4e9}, "not yet valid"),
        ({"iss": "https://evil.example"}, "issuer"),
        ({"iss": None}, "iss"),
        ({"aud": "another service"}, "Audience"),
        ({"aud": None}, "aud"),
    ],
)
def test_tokens_with_wrong_or_missing_claims_are_refused(
    provider: Provider, claims: dict[str, Any], words: str
) -> None:
    with pytest.raises(UnauthenticatedError, match=words):
        OidcTokens(provider.settings()).identify(provider.token(**claims))


_LEAVES = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters(codec=None)) | st.just(10**400)
)
ANY_JSON = st.recursive(
    _LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
)
CLAIMS = ("realm_access", "scope", "sub", "client_id", "exp", "nbf", "iat", "jti", "aud", "iss")


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(claims=st.dictionaries(st.sampled_from(CLAIMS), ANY_JSON, max_size=3), roles=ANY_JSON)
@example(claims={}, roles=[["crew"], {"a": 1}, None])
@example(claims={"exp": float("inf")}, roles="crew")
@example(claims={"exp": 10**400}, roles="crew")
@example(claims={"nbf": [1]}, roles="crew")
@example(claims={"iat": {"a": 1}}, roles="crew")
@example(claims={"sub": {"a": []}}, roles="crew")
def test_claims_of_any_shape_are_answered_by_an_identity_or_a_refusal(
    provider: Provider, guarded: FastAPI, claims: dict[str, Any], roles: Any
) -> None:
    bearer = provider.token_with({"realm_access": {"roles": roles}} | claims)
    response = ask(guarded, "GET", "/api/v1/access", headers={"authorization": f"Bearer {bearer}"})
    assert response.status_code in (200, 401, 403), response.text


def test_a_role_among_values_that_are_no_text_still_counts(provider: Provider) -> None:
    tokens = OidcTokens(provider.settings())
    assert tokens.identify(provider.token(scope=[["x"], {}, 7, None, "dropanchor:write"])).scope is Scope.WRITE


def test_a_token_that_names_no_key_is_tried_with_the_only_one(provider: Provider) -> None:
    assert OidcTokens(provider.settings()).identify(provider.token(kid=None)).name == "ann"
    forged = provider.token(kid=None, key=_key_named("forged"))
    with pytest.raises(UnauthenticatedError, match="Signature"):
        OidcTokens(provider.settings()).identify(forged)
    provider.new_key("two")
    with pytest.raises(UnauthenticatedError, match="publishes several"):
        OidcTokens(provider.settings()).identify(provider.token(kid=None))


def test_forged_signatures_are_refused(provider: Provider) -> None:
    tokens = OidcTokens(provider.settings())
    foreign = _key_named("foreign")
    public = provider.keys["one"].public_key()
    for forged in (
        provider.token(key=foreign),
        provider.token(key=ec.generate_private_key(ec.SECP256R1()), algorithm="ES256"),
        provider.token(key="the public key as a password, 32 bytes", algorithm="HS256"),
        jwt.encode({"sub": "ann"}, "", algorithm="none"),
        provider.token()[:-4] + "AAAA",
        "a.b.c",
        "..",
    ):
        with pytest.raises(UnauthenticatedError):
            tokens.identify(forged)
    assert public is not None


def test_a_new_key_is_found_and_unknown_key_ids_cost_the_provider_one_request(provider: Provider) -> None:
    now_s = 0.0
    keys = SigningKeys(provider.url, f"{provider.url}/keys", lambda: now_s)
    assert keys.find("one")
    provider.new_key("two")
    for _ in range(50):
        with pytest.raises(UnauthenticatedError, match="does not publish"):
            keys.find("two")
    assert provider.requested == ["/keys"]
    now_s = RETRY_S + 0.1
    assert keys.find("two")
    assert provider.requested == ["/keys", "/keys"]


def test_an_unreachable_provider_is_named_and_its_fetched_keys_stay_valid(provider: Provider) -> None:
    now_s = 0.0
    unreachable = SigningKeys("http://127.0.0.1:9", None, lambda: now_s)
    with pytest.raises(UnauthenticatedError, match="does not answer"):
        unreachable.find("one")
    keys = SigningKeys(provider.url, f"{provider.url}/keys", lambda: now_s)
    assert keys.find("one")
    provider.keys.clear()
    provider.answer = lambda _path: {"keys": "none"}  # type: ignore[method-assign, assignment]
    now_s = 1e6
    assert keys.find("one")


def test_no_token_waits_for_a_hanging_provider_whose_keys_were_fetched(provider: Provider) -> None:
    now_s = 0.0
    keys = SigningKeys(provider.url, f"{provider.url}/keys", lambda: now_s)
    keys.find("one")
    requested, release, answer = Event(), Event(), provider.answer

    def hang(path: str) -> dict[str, Any]:
        requested.set()
        release.wait()
        return answer(path)

    provider.answer = hang  # type: ignore[method-assign]
    now_s = 1e6
    first = Thread(target=keys.find, args=["one"])
    first.start()
    assert requested.wait(PATIENCE_S)
    assert keys.find("one")
    assert first.is_alive()
    release.set()
    first.join()


def test_keys_come_only_from_the_configured_address(provider: Provider) -> None:
    provider.moved_to = f"{provider.url}/other"
    with pytest.raises(UnauthenticatedError, match="does not answer"):
        SigningKeys(provider.url, f"{provider.url}/keys").find("one")
    assert provider.requested == ["/keys"]


@pytest.mark.parametrize("jwks_uri", ["http://idp.example/keys", "file:///etc/passwd", None])
def test_keys_are_not_fetched_from_an_address_where_others_could_replace_them(
    provider: Provider, jwks_uri: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    provider.answer = lambda _path: {"jwks_uri": jwks_uri}  # type: ignore[method-assign, assignment]
    with pytest.raises(UnauthenticatedError, match="does not answer"):
        SigningKeys(provider.url, None).find("one")
    assert "an address that begins with https://" in caplog.text


@pytest.mark.parametrize("url", ["http://idp.example", "file:///etc/passwd", "idp.example"])
def test_a_provider_without_https_is_refused(url: str) -> None:
    with pytest.raises(ValidationError, match="https://"):
        OidcSettings.model_validate({"issuer": url, "audience": AUDIENCE})

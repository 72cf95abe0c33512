"""Authentication, authorization and rate limits of the REST interface."""

import json
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from dropanchor_service.api.http.permissions import OPEN_PATHS
from dropanchor_service.api.http.rates import MAX_CLIENTS, RateLimiter
from dropanchor_service.api.routes import examples
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from support.api import ask, kind_of, make_api_bench
from support.http_server import running_server

READ, WRITE, ADMIN = Scope.READ, Scope.WRITE, Scope.ADMIN


class Guarded:
    """An interface with one key of each scope."""

    def __init__(self, folder: Path, rate_limiter: RateLimiter | None = None) -> None:
        self.clock_s = 0.0
        self.keys = ApiKeys(folder, lambda: self.clock_s)
        self.secrets = {scope: self.keys.add(scope.word, scope) for scope in Scope}
        self.bench = make_api_bench()
        self.bench.move("a")
        self.app: FastAPI = self.bench.app(authenticator=Authenticator({SOURCE: self.keys}), rate_limiter=rate_limiter)

    def ask(self, method: str, path: str, secret: str | Scope | None = None, **options: Any) -> httpx.Response:
        credential = self.secrets[secret] if isinstance(secret, Scope) else secret
        headers = {} if credential is None else {"authorization": f"Bearer {credential}"}
        return ask(self.app, method, path, headers=headers, **options)


@pytest.fixture
def guarded(tmp_path: Path) -> Guarded:
    return Guarded(tmp_path)


def test_every_operation_but_the_open_ones_needs_credentials(guarded: Guarded) -> None:
    paths = guarded.app.openapi()["paths"]
    assert len(paths) > 50
    for method, path in ((method, path) for path, operations in paths.items() for method in operations):
        response = guarded.ask(method.upper(), path.replace("{tag}", "a").replace("{anchor}", "17"))
        if path in OPEN_PATHS:
            assert response.status_code == 200, path
        else:
            assert kind_of(response) == "unauthenticated", (method, path)
            assert response.headers["www-authenticate"].startswith("Bearer")
            assert "dropanchor key add" in response.json()["detail"]


@pytest.mark.parametrize(
    "path",
    [
        "/api/v1/nothing",
        "/api/v1/../v1/poses",
        "/%61pi/v1/poses",
        "/api%2Fv1/poses",
        "/metrics",
        "/api/v1/poses?tags=a",
    ],
)
def test_no_spelling_of_a_path_bypasses_authentication(guarded: Guarded, path: str) -> None:
    response = guarded.ask("GET", path)
    assert response.status_code in (401, 404)
    assert "covariance" not in response.text


@pytest.mark.parametrize(
    ("method", "path", "body", "required"),
    [
        ("GET", "/api/v1/poses", None, READ),
        ("GET", "/metrics", None, READ),
        ("PUT", "/api/v1/tags/a/settings", {}, WRITE),
        ("PUT", "/api/v1/anchors/17", {"id": "17"}, WRITE),
        ("PUT", "/api/v1/site", examples.SITE, ADMIN),
        ("DELETE", "/api/v1/anchors/17", None, ADMIN),
    ],
)
def test_a_key_allows_what_its_scope_includes_and_no_more(
    guarded: Guarded, method: str, path: str, body: Any, required: Scope
) -> None:
    for scope in Scope:
        response = guarded.ask(method, path, scope, json=body)
        if scope >= required:
            assert response.status_code < 300, response.text
            break
        assert kind_of(response) == "forbidden"
        assert f"this request needs the scope {required.word}" in response.json()["detail"]


@pytest.mark.parametrize(
    "header", ["", "Bearer", "Bearer ", "Basic YTpi", "Bearer dropanchor_00000000_x", "Bearer a.b.c", "Bearer \xff"]
)
def test_invalid_credentials_are_refused(guarded: Guarded, header: str) -> None:
    response = ask(guarded.app, "GET", "/api/v1/poses", headers={"authorization": header.encode("latin-1")})
    assert kind_of(response) == "unauthenticated"


def test_a_key_that_differs_in_one_letter_is_refused(guarded: Guarded) -> None:
    secret = guarded.secrets[READ]
    other = secret[:-1] + ("A" if secret[-1] != "A" else "B")
    assert guarded.ask("GET", "/api/v1/poses", secret).status_code == 200
    assert kind_of(guarded.ask("GET", "/api/v1/poses", other)) == "unauthenticated"


def test_revoking_a_key_ends_its_streams(tmp_path: Path) -> None:
    guarded = Guarded(tmp_path)
    headers = {"authorization": f"Bearer {guarded.secrets[READ]}"}
    with running_server(guarded.app, guarded.bench.stopping) as port:
        url = f"http://127.0.0.1:{port}/api/v1/stream?max_hz=30"
        with httpx.stream("GET", url, headers=headers, trust_env=False, verify=False) as stream:
            lines = stream.iter_lines()
            assert next(lines) == "event: snapshot"
            ApiKeys(tmp_path).revoke("read")
            guarded.clock_s += 2.0
            for number in range(20):
                guarded.bench.move("a", x=float(number))
                if not list(zip(range(3), lines, strict=False)):
                    break
            assert list(lines) == []
        assert httpx.get(url, headers=headers, trust_env=False, verify=False).status_code == 401


def test_the_rate_limit_applies_to_each_client_separately(tmp_path: Path) -> None:
    now_s = 0.0
    guarded = Guarded(tmp_path, RateLimiter(per_s=2.0, burst=3, clock=lambda: now_s))
    statuses = [guarded.ask("GET", "/api/v1/poses", READ).status_code for _ in range(4)]
    assert statuses == [200, 200, 200, 429]
    limited = guarded.ask("GET", "/api/v1/poses", READ)
    assert kind_of(limited) == "too-many-requests"
    assert limited.headers["retry-after"] == "1"
    assert guarded.ask("GET", "/api/v1/poses", WRITE).status_code == 200
    now_s = 0.6
    assert guarded.ask("GET", "/api/v1/poses", READ).status_code == 200


def test_guessed_keys_are_rate_limited_by_address(tmp_path: Path) -> None:
    guarded = Guarded(tmp_path, RateLimiter(per_s=1.0, burst=3, clock=lambda: 0.0))
    guesses = [guarded.ask("GET", "/api/v1/poses", f"guess-{n}", address="192.0.2.1").status_code for n in range(5)]
    assert guesses == [401, 401, 401, 429, 429]
    assert guarded.ask("GET", "/api/v1/poses", READ, address="192.0.2.1").status_code == 200


def test_without_credentials_only_loopback_has_no_rate_limit() -> None:
    app = make_api_bench().app(rate_limiter=RateLimiter(per_s=1.0, burst=2, clock=lambda: 0.0))

    def statuses(*addresses: str) -> set[int]:
        return {ask(app, "GET", "/api/v1/poses", address).status_code for address in addresses}

    assert statuses(*["127.0.0.1"] * 5) == {200}
    assert statuses(*["192.0.2.1"] * 5) == {200, 429}
    assert statuses("2001:db8::1", "2001:db8::2", "2001:db8::3") == {200, 429}


def test_the_rate_limiter_remembers_a_bounded_number_of_clients() -> None:
    rate_limiter = RateLimiter(per_s=1.0, burst=1, clock=lambda: 0.0)
    assert rate_limiter.wait_s("first") == 0.0
    assert rate_limiter.wait_s("first") == 1.0
    for number in range(MAX_CLIENTS):
        rate_limiter.wait_s(str(number))
    assert rate_limiter.wait_s("first") == 0.0


def test_every_response_has_security_headers_and_no_other_origin_may_read_it(guarded: Guarded) -> None:
    for path in ("/api/v1/poses", "/api/v1/nothing", "/api/v1/health/live"):
        response = guarded.ask("GET", path, READ, address="192.0.2.1")
        assert response.headers["x-content-type-options"] == "nosniff"
        assert response.headers["referrer-policy"] == "no-referrer"
        assert "default-src 'none'" in response.headers["content-security-policy"]
    response = ask(guarded.app, "GET", "/api/v1/health/live", headers={"origin": "https://evil.example"})
    assert not any(name.startswith("access-control") for name in response.headers)


def test_the_document_declares_authentication_and_its_errors(guarded: Guarded) -> None:
    document = json.loads(guarded.ask("GET", "/api/v1/openapi.json").text)
    assert document["components"]["securitySchemes"]["bearer"]["scheme"] == "bearer"
    for path, operations in document["paths"].items():
        for operation in operations.values():
            assert ({"401", "403", "429"} <= set(operation["responses"])) == (path not in OPEN_PATHS)

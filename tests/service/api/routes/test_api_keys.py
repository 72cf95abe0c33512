"""Keys that an administrator hands out over REST: what they may, where, and until when."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from dropanchor_service.security.api_keys import FILE, SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from support.api import ask, kind_of, make_api_bench


@dataclass
class Guarded:
    """An interface that an administrator has a key of."""

    app: FastAPI
    keys: ApiKeys
    boss: str

    def ask(self, method: str, path: str, secret: str = "", **options: Any) -> httpx.Response:
        headers = {"authorization": f"Bearer {secret or self.boss}"}
        return ask(self.app, method, f"/api/v1/{path}", headers=headers, **options)

    def create(self, **request: Any) -> dict[str, Any]:
        created: dict[str, Any] = self.ask("POST", "keys", json=request).raise_for_status().json()
        return created


@pytest.fixture
def guarded(tmp_path: Path) -> Guarded:
    keys = ApiKeys(tmp_path)
    boss = keys.add("boss", Scope.ADMIN)
    bench = make_api_bench()
    bench.move("cart")
    return Guarded(bench.app(authenticator=Authenticator({SOURCE: keys})), keys, boss)


def test_a_key_does_what_it_is_for_until_it_is_revoked(guarded: Guarded) -> None:
    made = guarded.create(name="Early shift", scope="write")
    assert guarded.ask("GET", "poses", made["secret"]).status_code == 200
    assert guarded.ask("PUT", "tags/cart/settings", made["secret"], json={"name": "Cart"}).status_code == 200
    assert kind_of(guarded.ask("GET", "keys", made["secret"])) == "forbidden"
    assert guarded.ask("DELETE", f"keys/{made['id']}").status_code == 204
    assert kind_of(guarded.ask("GET", "poses", made["secret"])) == "unauthenticated"
    assert kind_of(guarded.ask("DELETE", f"keys/{made['id']}")) == "unknown-key"


def test_a_key_of_a_phone_sends_the_samples_of_its_tag_alone(guarded: Guarded) -> None:
    secret = guarded.create(name="Anna's phone", tag="anna", days=7)["secret"]
    sent = guarded.ask("POST", "ingest/samples", secret, json={"range": []})
    assert sent.status_code not in (401, 403), sent.text
    assert kind_of(guarded.ask("GET", "poses", secret)) == "forbidden"


def test_the_list_has_no_secret_and_no_key_of_an_administrator(guarded: Guarded) -> None:
    made = guarded.create(name="Screen", scope="read", days=1)
    answer = guarded.ask("GET", "keys")
    assert [key["name"] for key in answer.json()["keys"]] == ["Screen"]
    assert answer.json()["keys"][0]["expires_ns"] - made["made_ns"] == 86_400 * 10**9
    assert made["secret"] not in answer.text
    (boss,) = (identifier for identifier, key in guarded.keys.all().items() if key.name == "boss")
    assert kind_of(guarded.ask("DELETE", f"keys/{boss}")) == "unknown-key"


@pytest.mark.parametrize(
    ("request_", "kind"),
    [
        ({"name": "a", "scope": "admin"}, "invalid-request"),
        ({"name": "a"}, "invalid-request"),
        ({"name": "a", "scope": "read", "tag": "cart"}, "invalid-request"),
        ({"name": "a", "tag": "cart*"}, "invalid-request"),
        ({"name": "", "scope": "read"}, "invalid-request"),
        ({"name": "a", "scope": "read", "days": 367}, "invalid-request"),
        ({"name": "boss", "scope": "read"}, "exists-already"),
    ],
)
def test_a_key_that_cannot_be_is_refused(guarded: Guarded, request_: dict[str, Any], kind: str) -> None:
    assert kind_of(guarded.ask("POST", "keys", json=request_)) == kind


def test_without_access_control_nobody_needs_a_key() -> None:
    app = make_api_bench().app()
    assert ask(app, "GET", "/api/v1/keys").json() == {"available": False, "keys": []}
    assert kind_of(ask(app, "POST", "/api/v1/keys", json={"name": "a", "scope": "read"})) == "no-access-control"


def test_a_key_that_somebody_else_revokes_or_a_damaged_file_is_named(guarded: Guarded, tmp_path: Path) -> None:
    made = guarded.create(name="Early shift", scope="read")
    ApiKeys(tmp_path).revoke("Early shift")  # the service looks at the file once in a second
    instead = ApiKeys(tmp_path).add("Early shift", Scope.ADMIN)
    assert kind_of(guarded.ask("DELETE", f"keys/{made['id']}")) == "unknown-key"
    assert ApiKeys(tmp_path).identify(instead).scope is Scope.ADMIN
    late = guarded.create(name="Late shift", scope="read")
    (tmp_path / FILE).write_text("{")
    refused = guarded.ask("DELETE", f"keys/{late['id']}")
    assert kind_of(refused) == "not-saved"
    assert "is damaged" in refused.json()["detail"]

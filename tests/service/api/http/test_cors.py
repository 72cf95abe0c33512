"""Web pages of other origins may use the interface only where a setting allows them."""

from pathlib import Path

import httpx
import pytest

from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator
from support.api import ask, make_api_bench

BOARD = "https://board.example"
PERMISSION = "access-control-allow-origin"


def preflight(folder: Path, origins: tuple[str, ...], origin: str) -> httpx.Response:
    """Return the answer to the question of a browser whether a page may send a key."""
    app = make_api_bench().app(authenticator=Authenticator({SOURCE: ApiKeys(folder)}), cors_origins=origins)
    asked = {"access-control-request-method": "PUT", "access-control-request-headers": "authorization"}
    return ask(app, "OPTIONS", "/api/v1/site", headers={"origin": origin} | asked)


@pytest.mark.parametrize("origins", [(BOARD,), ("*",)])
def test_a_listed_origin_may_send_a_key(tmp_path: Path, origins: tuple[str, ...]) -> None:
    answer = preflight(tmp_path, origins, BOARD)
    assert answer.status_code == 200
    assert answer.headers[PERMISSION] in (BOARD, "*")
    assert "authorization" in answer.headers["access-control-allow-headers"].lower()


@pytest.mark.parametrize("origins", [(), (BOARD,)])
def test_another_origin_gets_no_permission(tmp_path: Path, origins: tuple[str, ...]) -> None:
    assert PERMISSION not in preflight(tmp_path, origins, "https://elsewhere.example").headers


def test_a_page_of_a_listed_origin_can_read_why_it_was_refused(tmp_path: Path) -> None:
    app = make_api_bench().app(authenticator=Authenticator({SOURCE: ApiKeys(tmp_path)}), cors_origins=(BOARD,))
    answer = ask(app, "GET", "/api/v1/poses", headers={"origin": BOARD})
    assert (answer.status_code, answer.headers[PERMISSION]) == (401, BOARD)

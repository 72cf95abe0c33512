"""What a GET says can be made, a POST makes, and what it says cannot be made, a POST refuses."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from dropanchor_service.security import api_keys, share_links
from dropanchor_service.security.api_keys import FILE, FORMER_FILE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.security.share_links import ShareLinks
from service.data_folder import without_rights
from support.api import ask, kind_of, make_api_bench
from support.service import ROOT

RESOURCES: dict[str, dict[str, Any]] = {"keys": {"name": "a", "scope": "read"}, "shares": {"name": "a", "valid_s": 60}}


@pytest.fixture
def folder() -> Iterator[Path]:
    """Return a folder that other users reach, unlike those of pytest."""
    with TemporaryDirectory() as parent:
        made = Path(parent, "made")
        made.mkdir()
        yield made


@contextmanager
def writable(_folder: Path) -> Iterator[None]:
    yield


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    with without_rights(folder):
        below = [path for path in (folder, *folder.rglob("*")) if path.is_dir()]
        for path in below:
            path.chmod(0o500)
        try:
            yield
        finally:
            for path in below:
                path.chmod(0o700)


@pytest.mark.parametrize(("state", "kind"), [(writable, None), (read_only, "not-saved"), (None, "no-access-control")])
@pytest.mark.parametrize("resource", RESOURCES)
def test_what_is_available_can_be_made_and_nothing_else(
    resource: str, state: Callable[[Path], Any] | None, kind: str | None, folder: Path
) -> None:
    keys, links = ApiKeys(folder), ShareLinks(folder)
    boss = keys.add("boss", Scope.ADMIN)
    guard = Authenticator({api_keys.SOURCE: keys, share_links.SOURCE: links})
    app = make_api_bench().app(authenticator=None if state is None else guard)
    path, headers = f"/api/v1/{resource}", {"authorization": f"Bearer {boss}"}
    with (state or writable)(folder):
        promised = ask(app, "GET", path, headers=headers).json()["available"]
        answer = ask(app, "POST", path, headers=headers, json=RESOURCES[resource])
    assert promised == (answer.status_code == 201) == (kind is None)
    assert kind is None or kind_of(answer) == kind


def test_every_resource_that_says_whether_it_is_available_is_tried_here() -> None:
    document = json.loads((ROOT / "schemas" / "dropanchor_schemas" / "openapi.json").read_text())
    models = {
        name for name, model in document["components"]["schemas"].items() if "available" in model.get("properties", ())
    }
    assert models == {"AccessKeyList", "ShareList"}


def test_keys_that_other_machines_have_too_are_made_by_command_alone(tmp_path: Path) -> None:
    boss = ApiKeys(tmp_path).add("boss", Scope.ADMIN)
    app = make_api_bench().app(authenticator=Authenticator({api_keys.SOURCE: ApiKeys(tmp_path, is_copied=True)}))
    headers = {"authorization": f"Bearer {boss}"}
    assert ask(app, "GET", "/api/v1/keys", headers=headers).json()["available"] is False
    refused = ask(app, "POST", "/api/v1/keys", headers=headers, json=RESOURCES["keys"])
    assert (kind_of(refused), "dropanchor key" in refused.json()["detail"]) == ("not-saved", True)


def test_keys_of_an_earlier_version_work_and_their_file_goes_with_the_first_change(tmp_path: Path) -> None:
    ApiKeys(tmp_path).add("first", Scope.READ)
    (tmp_path / FILE).rename(tmp_path / FORMER_FILE)
    keys = ApiKeys(tmp_path)
    assert [key.name for key in keys.all().values()] == ["first"]
    keys.add("second", Scope.READ)
    assert [key.name for key in ApiKeys(tmp_path).all().values()] == ["first", "second"]
    keys.revoke("first")
    assert not (tmp_path / FORMER_FILE).exists()

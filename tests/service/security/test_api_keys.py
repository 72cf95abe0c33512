"""API keys: shown once, stored as hashes, and reloaded while the service runs."""

import stat
from pathlib import Path

import pytest

from dropanchor_service.cli import main
from dropanchor_service.security.api_keys import FILE, ApiKeyError, ApiKeys
from dropanchor_service.security.identity import Scope, UnauthenticatedError
from support.secured import secured_site


def test_a_key_has_a_scope_and_only_its_hash_is_stored(tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    secret = keys.add("dashboard", Scope.WRITE)
    identity = keys.identify(secret)
    assert (identity.name, identity.scope) == ("dashboard", Scope.WRITE)
    stored = (tmp_path / FILE).read_text()
    assert secret not in stored
    assert secret.rpartition("_")[2] not in stored
    assert stat.S_IMODE((tmp_path / FILE).stat().st_mode) == 0o600


def test_a_running_service_follows_changes_of_the_file_within_a_second(tmp_path: Path) -> None:
    now_s = 0.0
    running = ApiKeys(tmp_path, lambda: now_s)
    secret = ApiKeys(tmp_path).add("late", Scope.READ)
    now_s = 1.1
    assert running.identify(secret).name == "late"
    assert running.is_still_valid(running.identify(secret))
    identity = running.identify(secret)
    ApiKeys(tmp_path).revoke("late")
    now_s = 2.2
    assert not running.is_still_valid(identity)
    with pytest.raises(UnauthenticatedError, match="was revoked"):
        running.identify(secret)


def test_the_list_follows_changes_of_the_file(tmp_path: Path) -> None:
    now_s = 0.0
    running = ApiKeys(tmp_path, lambda: now_s)
    ApiKeys(tmp_path).add("late", Scope.READ)
    now_s = 1.1
    assert [key.name for key in running.all().values()] == ["late"]  # nobody has used a key since


def test_a_new_key_of_the_same_name_does_not_keep_the_streams_of_a_revoked_one(tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    lost = keys.identify(keys.add("phone", Scope.READ))
    keys.revoke("phone")
    found = keys.identify(keys.add("phone", Scope.READ))
    assert keys.is_still_valid(found)
    assert not keys.is_still_valid(lost)


def test_an_expired_key_is_refused_as_expired(tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    secret = keys.add("short", Scope.READ, days=-1)
    with pytest.raises(UnauthenticatedError, match="has expired"):
        keys.identify(secret)


def test_a_damaged_file_stops_the_start_but_does_not_affect_a_running_service(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    now_s = 0.0
    running = ApiKeys(tmp_path, lambda: now_s)
    secret = running.add("a", Scope.READ)
    (tmp_path / FILE).write_text("{")
    now_s = 2.0
    assert running.identify(secret).name == "a"
    assert "is damaged" in caplog.text
    with pytest.raises(ApiKeyError, match="is damaged"):
        ApiKeys(tmp_path)


def test_the_command_line_adds_lists_and_revokes_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = secured_site(tmp_path / "security").folder.path
    folder = ["--security", str(path)]
    assert main(["key", "add", "dash", "--scope", "read", *folder]) == 0
    secret = capsys.readouterr().out.strip()
    assert ApiKeys(path).identify(secret).scope is Scope.READ
    assert main(["key", "add", "dash", *folder]) == 2
    assert "a key named 'dash' exists already" in capsys.readouterr().err
    assert main(["key", "list", *folder]) == 0
    listed = capsys.readouterr().out
    assert listed.startswith("dash\tread\tnever expires")
    assert secret not in listed
    assert main(["key", "revoke", "dash", *folder]) == 0
    assert main(["key", "revoke", "dash", *folder]) == 2
    assert "there is no key named 'dash'" in capsys.readouterr().err


def test_the_command_line_makes_keys_of_a_site_and_refuses_a_tag_without_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = secured_site(tmp_path / "security", site="north").folder.path
    folder = ["--security", str(path)]
    assert main(["key", "add", "before", *folder]) == 0
    assert "site" not in (path / FILE).read_text()
    assert main(["security", "add-site", "south", *folder]) == 0
    capsys.readouterr()
    assert main(["key", "add", "manager", "--scope", "write", "--site", "south", *folder]) == 0
    identity = ApiKeys(path).identify(capsys.readouterr().out.strip())
    assert [identity.scope_in(site) for site in ("south", "north", None)] == [Scope.WRITE, None, None]
    assert main(["key", "add", "phone", "--tag", "cart", *folder]) == 2
    assert "say which site it is of, with --site: north, south" in capsys.readouterr().err
    assert main(["key", "add", "west", "--site", "west", *folder]) == 2
    assert "there is no site 'west'" in capsys.readouterr().err
    assert main(["key", "add", "phone", "--tag", "cart", "--site", "north", *folder]) == 0
    capsys.readouterr()
    assert main(["key", "list", *folder]) == 0
    listed = capsys.readouterr().out
    assert "manager\twrite in site 'south'" in listed
    assert "phone\tingest of tag 'cart' in site 'north'" in listed

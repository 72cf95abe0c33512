"""API keys: shown once, kept as hashes, followed while the service runs."""

import stat
from pathlib import Path

import pytest

from dropanchor_service.cli import main
from dropanchor_service.security.api_keys import FILE, ApiKeyError, ApiKeys
from dropanchor_service.security.identity import Scope, UnauthenticatedError
from support.secured import secured_site


def test_a_key_is_known_with_its_scope_and_only_its_hash_is_kept(tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    secret = keys.add("dashboard", Scope.WRITE)
    identity = keys.identify(secret)
    assert (identity.name, identity.scope) == ("dashboard", Scope.WRITE)
    kept = (tmp_path / FILE).read_text()
    assert secret not in kept
    assert secret.rpartition("_")[2] not in kept
    assert stat.S_IMODE((tmp_path / FILE).stat().st_mode) == 0o600


def test_a_running_service_follows_within_a_second(tmp_path: Path) -> None:
    now_s = 0.0
    running = ApiKeys(tmp_path, lambda: now_s)
    secret = ApiKeys(tmp_path).add("late", Scope.READ)
    now_s = 1.1
    assert running.identify(secret).name == "late"
    assert running.is_still_good(running.identify(secret))
    identity = running.identify(secret)
    ApiKeys(tmp_path).revoke("late")
    now_s = 2.2
    assert not running.is_still_good(identity)
    with pytest.raises(UnauthenticatedError, match="was revoked"):
        running.identify(secret)


def test_an_expired_key_is_told_so(tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    secret = keys.add("short", Scope.READ, days=-1)
    with pytest.raises(UnauthenticatedError, match="has expired"):
        keys.identify(secret)


def test_a_file_that_is_damaged_while_the_service_runs_changes_nothing_and_one_at_the_start_is_told(
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


def test_keys_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = secured_site(tmp_path / "security").folder.path
    folder = ["--security", str(path)]
    assert main(["key", "add", "dash", "--scope", "read", *folder]) == 0
    secret = capsys.readouterr().out.strip()
    assert ApiKeys(path).identify(secret).scope is Scope.READ
    assert main(["key", "add", "dash", *folder]) == 2
    assert "there is a key 'dash'" in capsys.readouterr().err
    assert main(["key", "list", *folder]) == 0
    listed = capsys.readouterr().out
    assert listed.startswith("dash\tread\tnever expires")
    assert secret not in listed
    assert main(["key", "revoke", "dash", *folder]) == 0
    assert main(["key", "revoke", "dash", *folder]) == 2
    assert "there is no key 'dash'" in capsys.readouterr().err

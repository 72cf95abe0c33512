"""Where the service keeps the key and the list of its share links."""

from pathlib import Path

from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.security.credentials import authenticator_of
from dropanchor_service.security.share_links import KEY_BYTES, KEY_FILE, share_links_of
from dropanchor_service.settings.model import SecuritySettings, Settings


def settings_of(security: Path | None, data: Path | None) -> Settings:
    return Settings(security=SecuritySettings(folder=security), data_dir=data)


def test_the_key_is_in_the_data_folder_or_else_in_the_security_folder(tmp_path: Path) -> None:
    security, data = tmp_path / "security", tmp_path / "data"
    security.mkdir()
    assert share_links_of(authenticator_of(settings_of(security, None))) is not None
    assert (security / KEY_FILE).exists()
    assert share_links_of(authenticator_of(settings_of(security, data))) is not None
    assert (data / KEY_FILE).exists()


def test_a_service_without_access_control_has_no_share_links_and_makes_no_key(tmp_path: Path) -> None:
    assert authenticator_of(settings_of(None, tmp_path)) is None
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_key_ends_all_links_and_is_reported(tmp_path: Path) -> None:
    (tmp_path / KEY_FILE).write_bytes(b"short")
    recovery = Recovery()
    links = share_links_of(authenticator_of(settings_of(tmp_path / "security", tmp_path), recovery=recovery))
    assert links is not None
    assert len((tmp_path / KEY_FILE).read_bytes()) == KEY_BYTES
    (problem,) = recovery.problems()
    assert problem.startswith(f"{KEY_FILE} is damaged; all share links have ended: look at ")

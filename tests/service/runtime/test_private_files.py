"""Only the user of the service reads its data folder."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from dropanchor_service.runtime.private_files import keep_private


@pytest.fixture(autouse=True)
def umask() -> Iterator[None]:
    before = os.umask(0o022)
    yield
    os.umask(before)


def modes(folder: Path) -> dict[str, int]:
    return {path.name: stat.S_IMODE(path.stat().st_mode) for path in [folder, *folder.rglob("*")]}


def test_what_is_written_from_now_on_is_private(tmp_path: Path) -> None:
    keep_private(tmp_path / "data")
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "site.json").write_text("{}")
    assert modes(tmp_path / "data") == {"data": 0o700, "site.json": 0o600}


def test_a_folder_of_an_older_service_becomes_private_and_links_out_of_it_are_left_alone(tmp_path: Path) -> None:
    elsewhere, data = tmp_path / "elsewhere", tmp_path / "data"
    elsewhere.write_text("of somebody else")
    (data / "recordings").mkdir(parents=True)
    for name in ("site.json", "recordings/a.mcap"):
        (data / name).write_text("")
    (data / "link").symlink_to(elsewhere)
    keep_private(data)
    assert stat.S_IMODE(elsewhere.stat().st_mode) == 0o644
    (data / "link").unlink()
    assert modes(data) == {"data": 0o700, "recordings": 0o700, "site.json": 0o600, "a.mcap": 0o600}


def test_files_of_others_in_the_folder_and_the_folder_with_them_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    (tmp_path / "public").mkdir()
    for name in ("site.json", "recordings/a.mcap", "public/index.html"):
        (tmp_path / name).write_text("")
    tmp_path.chmod(0o1777)
    keep_private(tmp_path)
    assert stat.S_IMODE(tmp_path.stat().st_mode) == 0o1777
    kept, private = {"public": 0o755, "index.html": 0o644}, {"recordings": 0o700, "site.json": 0o600, "a.mcap": 0o600}
    found = modes(tmp_path)
    assert {name: found[name] for name in (*kept, *private)} == kept | private


def test_a_folder_of_another_user_is_named_and_the_service_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(_path: Path, _mode: int) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "chmod", refuse)
    tmp_path.touch()
    os.chmod(tmp_path, 0o755)
    keep_private(tmp_path)
    assert f"chmod -R go= {tmp_path}" in caplog.text

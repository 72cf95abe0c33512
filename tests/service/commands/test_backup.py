"""A backup is complete, is made of a running service and tells what is damaged; a restore overwrites nothing."""

import os
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dropanchor_service.cli import main
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.security.issued import Table
from service.data_folder import CHECKPOINT, DATABASES, Parts, file_in, full_disk, opened


@pytest.fixture(autouse=True)
def umask() -> Iterator[None]:
    """A command sets it for its own process."""
    before = os.umask(0o022)
    yield
    os.umask(before)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the data and the credentials of a service, and settings that name them."""
    folder = tmp_path / "service"
    SecurityFolder.make(folder / "security", Table(site="default", hosts=("localhost",), listen=("tls/[::]:7447",)), 9)
    settings = f'data_dir = "{folder}/data"\n[security]\nfolder = "{folder}/security"\n'
    (folder / "dropanchor.toml").write_text(settings)
    return folder


@pytest.fixture
def running(folder: Path) -> Iterator[tuple[Parts, str]]:
    """The parts of a service that has written every file, and the token of a share link."""
    with opened(folder) as parts:
        yield parts, parts.fill()


def test_a_backup_of_a_running_service_has_all_that_it_wrote(
    folder: Path, running: tuple[Parts, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    backup, config = tmp_path / "backup", folder / "dropanchor.toml"
    assert main(["backup", str(config), str(backup)]) == 0
    assert "data, security, settings.toml; every file was read again" in capsys.readouterr().out
    assert (backup / "settings.toml").read_bytes() == config.read_bytes()
    assert (backup / "security" / "ca.key").stat().st_mode & 0o077 == 0
    running[0].close()
    for part in ("data", "security"):
        shutil.move(folder / part, tmp_path / f"lost-{part}")
    assert main(["restore", str(backup), str(config)]) == 0
    with opened(folder) as parts:
        assert [name for name, is_there in parts.held(running[1]).items() if not is_there] == []
        assert parts.recovery.problems() == []
    assert main(["restore", str(backup), str(config)]) == 2
    assert "is not empty" in capsys.readouterr().err


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip_pages(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    whole[100:4096] = bytes(3996)  # the schema of a database, the columns of a checkpoint
    path.write_bytes(whole)


@pytest.mark.parametrize(
    ("name", "damage"), [("zones.json", cut), (CHECKPOINT, cut), *((name, flip_pages) for name in DATABASES)]
)
def test_what_is_damaged_is_named_and_the_rest_is_in_the_backup(
    folder: Path,
    running: tuple[Parts, str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    damage: Callable[[Path], None],
) -> None:
    running[0].close()
    damage(file_in(folder, name))
    assert main(["backup", str(folder / "data"), str(tmp_path / "backup")]) == 1
    said = capsys.readouterr().err
    assert f"{Path(name).name} is damaged" in said
    assert len(said.splitlines()) == 1
    assert (tmp_path / "backup" / "data" / "site.json").exists()


@pytest.mark.usefixtures("running")
def test_a_backup_that_has_changed_is_not_restored(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    backup, target = tmp_path / "backup", tmp_path / "new"
    assert main(["backup", str(folder / "data"), str(backup)]) == 0
    assert main(["backup", str(folder / "data"), str(backup)]) == 2
    assert "exists already" in capsys.readouterr().err
    (target / "lost+found").mkdir(parents=True)  # a volume of its own
    assert main(["restore", str(backup), str(target)]) == 0
    shutil.rmtree(target)
    cut(backup / "data" / "history.sqlite")
    assert main(["restore", str(backup), str(target)]) == 2
    assert "data/history.sqlite is not what was written" in capsys.readouterr().err
    assert not target.exists()
    assert main(["restore", str(folder / "data"), str(target)]) == 2
    assert "is no backup" in capsys.readouterr().err


@pytest.mark.usefixtures("running")
def test_a_backup_that_fails_leaves_nothing_behind(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "backups").mkdir()
    with full_disk():
        assert main(["backup", str(folder / "data"), str(tmp_path / "backups" / "one")]) == 2
    assert "dropanchor backup: " in capsys.readouterr().err
    assert list((tmp_path / "backups").iterdir()) == []


@pytest.mark.usefixtures("running")
def test_of_several_backups_the_newest_are_kept_and_nothing_else_is_deleted(folder: Path, tmp_path: Path) -> None:
    backups = tmp_path / "backups"
    for name in ("20250101T000000Z", "20260101T000000Z", "by-hand"):
        assert main(["backup", str(folder / "data"), str(backups / name)]) == 0
    (backups / "20240101T000000Z").mkdir()
    assert main(["backup", str(folder / "data"), str(backups), "--keep", "2"]) == 0
    left = sorted(path.name for path in backups.iterdir())
    assert [*left[:2], left[-1]] == ["20240101T000000Z", "20260101T000000Z", "by-hand"]
    assert len(left) == 4
    time.sleep(1.0)  # their names are seconds
    cut(folder / "data" / "zones.json")
    assert main(["backup", str(folder / "data"), str(backups), "--keep", "1"]) == 1  # the older ones may be needed
    assert len(list(backups.iterdir())) == 5


@pytest.mark.usefixtures("running")
def test_a_history_in_a_database_is_left_to_its_own_tool(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with (folder / "dropanchor.toml").open("a") as file:
        file.write('[history]\nurl = "postgresql://db.example/yard"\n')
    assert main(["backup", str(folder / "dropanchor.toml"), str(tmp_path / "backup")]) == 0
    assert "pg_dump --format custom --file FILE postgresql://db.example/yard" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["backup", "nowhere", "backup"], "nowhere: no such folder"),
        (["backup", "nowhere.toml", "backup"], "nowhere.toml: cannot be read"),
        (["backup", "empty.toml", "backup"], "names neither data_dir nor security.folder"),
        (["restore", "nowhere", "data"], "nowhere is no backup"),
    ],
)
def test_what_cannot_be_copied_is_said_in_a_sentence(
    words: list[str], why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty.toml").touch()
    assert main(words) == 2
    assert why in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["empty.toml"]

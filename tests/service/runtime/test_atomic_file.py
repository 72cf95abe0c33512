"""Files are complete and on the disk, with their names, before a write returns."""

import os
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from dropanchor_schemas.site import Anchor, Site
from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.checkpoints.format import Snapshot
from dropanchor_service.recording.mcap_file import McapFile
from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.security.identity import Scope
from dropanchor_service.security.issued import Table
from dropanchor_service.store import SiteStore


def write_api_key(folder: Path) -> None:
    ApiKeys(folder).add("dashboard", Scope.READ)


def write_credentials(folder: Path) -> None:
    SecurityFolder.make(folder, Table(site="yard", hosts=("localhost",), listen=("tls/[::]:7447",)), days=1)


def write_site(folder: Path) -> None:
    SiteStore(Site(), {}, folder).set_anchor(Anchor(id="7"))


def write_checkpoint(folder: Path) -> None:
    CheckpointFolder(folder, "layout", lambda _, found: found).write(Snapshot())


def write_recording(folder: Path) -> None:
    McapFile(folder / "yard.mcap", {}).finish()


@pytest.mark.parametrize(
    "write", [write_api_key, write_credentials, write_site, write_checkpoint, write_recording], ids=lambda f: f.__name__
)
def test_a_written_file_and_its_name_are_synced_to_the_disk(
    write: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[Path] = []
    fsync = os.fsync

    def recorded(descriptor: int) -> None:
        synced.append(Path(os.readlink(f"/proc/self/fd/{descriptor}")))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", recorded)
    write(tmp_path)
    written = [path.with_name(path.name.removesuffix(".part")) for path in synced]
    kept = [path for path in tmp_path.rglob("*") if not path.name.startswith(".")]
    assert {path for path in kept if path.is_file()} == {path for path in written if path.is_file()}
    for path in kept:  # the name after the content
        assert path.parent in (written[written.index(path) :] if path.is_file() else written)


def test_a_private_file_is_private_from_its_first_byte(tmp_path: Path) -> None:
    path, part = tmp_path / "key", tmp_path / "key.part"
    part.write_bytes(b"left by a killed writer")
    part.chmod(0o666)
    seen: list[int] = []

    def content() -> bytes:
        seen.append(stat.S_IMODE(part.stat().st_mode))
        return b"secret"

    write_atomically(path, (content() for _ in range(1)), 0o600)
    assert seen == [stat.S_IMODE(path.stat().st_mode)] == [0o600]


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "site.json"
    write_atomically(path, [b"old"])

    def torn() -> bytes:
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        write_atomically(path, (part if part else torn() for part in (b"new", b"")))
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["site.json"]

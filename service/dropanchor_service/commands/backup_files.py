"""Copy what services have on disk, also while they run, and check each copy. Checksums tell what a backup holds.

Files are replaced as a whole and databases have a way to be copied, so nothing has to stop.
"""

import os
import shutil
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from datetime import UTC, datetime
from fnmatch import fnmatch
from hashlib import file_digest
from pathlib import Path

import orjson

from dropanchor_service.checkpoints.format import CheckpointError, unsealed
from dropanchor_service.history.sqlite.damaged_file import is_damage
from dropanchor_service.runtime.data_files import OF_SERVICE
from dropanchor_service.runtime.recovery import COPY

DATA, SECURITY, SETTINGS = "data", "security", "settings.toml"
CHECKSUMS = "SHA256SUMS"
_NOT_COPIED = ("owner.lock", ".lock", "*.part", "*.sqlite-wal", "*.sqlite-shm", "kernels-*", "*.box")
_BUSY_S = 30.0
_DATED = "%Y%m%dT%H%M%SZ"


class BackupError(Exception):
    """Nothing was copied, or not all; the message says why and what to do."""


def back_up(sources: Mapping[str, Path], target: Path) -> list[str]:
    """Copy folders and files into a new folder, each below its name. Return what is damaged, for people.

    The folder has another name until it is complete. Raises BackupError and OSError.
    """
    if target.exists():
        raise BackupError(f"{target} exists already: name a folder that does not")
    part = target.with_name(f"{target.name}.part")
    shutil.rmtree(part, ignore_errors=True)  # of one that was stopped
    part.mkdir(parents=True)
    try:
        problems: list[str] = []
        for name, source in sources.items():
            files = _files(source, OF_SERVICE) if name == DATA else _files(source)
            for file in [source] if source.is_file() else files:
                problems += _copied(file, part / name / file.relative_to(source))
        _write_checksums(part)
        os.sync()
        part.rename(target)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise
    return problems


def dated(folder: Path) -> Path:
    """Return the name of a backup in a folder of several."""
    return folder / datetime.now(UTC).strftime(_DATED)


def drop_oldest(folder: Path, keep: int) -> None:
    """Delete all but the newest of the backups with a date in a folder."""
    found = sorted(path.parent for path in folder.glob(f"*/{CHECKSUMS}") if _is_dated(path.parent.name))
    for backup in found[:-keep]:
        shutil.rmtree(backup)


def restore(backup: Path, targets: Mapping[str, Path]) -> None:
    """Copy parts of a backup to where they belong. Raises BackupError, and then nothing has changed, and OSError.

    targets: for each part its folder, which may exist but must be empty.
    """
    _refuse_changed(backup)
    for name, target in targets.items():
        if not (backup / name).is_dir():
            raise BackupError(f"{backup} holds no {name}")
        if any(_files(target)):
            raise BackupError(f"{target} is not empty: stop the service, and move what is in it away")
    for name, target in targets.items():
        shutil.copytree(backup / name, target, dirs_exist_ok=True)
    os.sync()


def _files(folder: Path, patterns: Sequence[str] = ("*",)) -> Iterator[Path]:
    """Yield the files of a folder, and then those of the folders in it, as they are by then.

    So images come after the plans that name them, and the newest checkpoint is there when it is copied.
    """
    found = sorted({path for pattern in patterns for path in folder.glob(pattern)}, reverse=True)
    copied = [path for path in found if not any(fnmatch(path.name, pattern) for pattern in _NOT_COPIED)]
    yield from (path for path in copied if path.is_file())
    for path in copied:
        if path.is_dir():
            yield from _files(path)


def _copied(file: Path, copy: Path) -> list[str]:
    """Copy a file and read the copy. Return what is wrong with it, in a list. Raises BackupError and OSError."""
    copy.parent.mkdir(parents=True, exist_ok=True)
    try:
        if file.suffix == ".sqlite":
            _copy_database(file, copy)
        else:
            shutil.copy2(file, copy)
        _check(copy)
    except FileNotFoundError:  # an old checkpoint or recording that the service has deleted meanwhile
        return []
    except (ValueError, CheckpointError, sqlite3.Error) as error:
        if isinstance(error, sqlite3.Error) and not is_damage(error):
            raise BackupError(
                f"{file} cannot be copied ({error}): look at the disk and at what this user may"
            ) from error
        return [f"{file} is damaged ({error}): the service names it when it starts"]
    return []


def _copy_database(file: Path, copy: Path) -> None:
    """Copy one state of a database that others may be writing. Raises sqlite3.Error."""
    uri = f"{file.absolute().as_uri()}?mode=ro"
    with closing(sqlite3.connect(uri, _BUSY_S, uri=True)) as source, closing(sqlite3.connect(copy)) as target:
        source.backup(target)
        target.execute("PRAGMA journal_mode = DELETE")  # one file, not three


def _check(copy: Path) -> None:
    """Raise ValueError, CheckpointError or sqlite3.Error if a copy cannot be read."""
    if copy.suffix == ".sqlite":
        with closing(sqlite3.connect(copy)) as connection:
            found = connection.execute("PRAGMA integrity_check(1)").fetchone()[0]
        if found != "ok":
            raise ValueError(found)
    elif copy.suffix == ".json" or copy.name.endswith(f".json{COPY}"):
        orjson.loads(copy.read_bytes())
    elif copy.name.startswith("checkpoint-"):
        unsealed(copy.read_bytes())


def _write_checksums(backup: Path) -> None:
    lines = [f"{_digest(file)}  {file.relative_to(backup)}\n" for file in _all_in(backup)]
    (backup / CHECKSUMS).write_text("".join(lines), encoding="utf-8")


def _refuse_changed(backup: Path) -> None:
    """Raise BackupError unless the files of a backup are those that were written."""
    try:
        lines = (backup / CHECKSUMS).read_text("utf-8").splitlines()
    except OSError as error:
        raise BackupError(f"{backup} is no backup: {CHECKSUMS} cannot be read ({error.strerror})") from error
    expected = {name: digest for digest, _, name in (line.partition("  ") for line in lines)}
    found = {str(file.relative_to(backup)): _digest(file) for file in _all_in(backup)}
    changed = sorted(name for name, digest in expected.items() if found.get(name) != digest)
    if changed:
        raise BackupError(f"{backup} is damaged: {', '.join(changed)} is not what was written: use another backup")


def _is_dated(name: str) -> bool:
    try:
        datetime.strptime(name, _DATED).replace(tzinfo=UTC)
    except ValueError:
        return False
    return True


def _all_in(backup: Path) -> list[Path]:
    return sorted(path for path in backup.rglob("*") if path.is_file() and path.name != CHECKSUMS)


def _digest(file: Path) -> str:
    with file.open("rb") as content:
        return file_digest(content, "sha256").hexdigest()

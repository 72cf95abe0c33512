"""Write and read checkpoints in a folder: whole ones, and what changed since one."""

import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from dropanchor_schemas.sentences import say
from dropanchor_service.checkpoints.changes import applied, changes
from dropanchor_service.checkpoints.format import (
    AsPresent,
    CheckpointError,
    Snapshot,
    UnreadableLayoutError,
    decoded,
    encoded,
    size_of,
)
from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_service.runtime.recovery import DAMAGED, Recovery

KEPT = 2
"""How many whole checkpoints are kept, and how many that continue each."""
CONTINUED = 2
"""What continues a whole checkpoint may have so many times its size: writing whole ones is a third of all."""
_PREFIX = "checkpoint-"
_NAME = re.compile(rf"(?:unread-)?{_PREFIX}(\d+)(?:-since-(\d+))?")
INSTEAD = say("checkpoint_before", "the one before is used, or else all tags start afresh")


class _ContinuesNothingError(CheckpointError):
    """A checkpoint may be whole, but not the one that it continues."""


class _File(NamedTuple):
    """number: the newest has the highest. since: number of the whole checkpoint that this one continues, or is."""

    number: int
    since: int
    path: Path


@dataclass
class _Whole:
    """A whole checkpoint. left_bytes: how many may still continue it, since what has changed grows with time."""

    path: Path
    snapshot: Snapshot
    left_bytes: int


class CheckpointFolder:
    """Checkpoints in a folder, written in one layout. Not thread-safe.

    A checkpoint that `as_present` cannot read is kept under another name, and so is one that is damaged, which
    `recovery` reports.
    """

    def __init__(self, folder: Path, layout: str, as_present: AsPresent, recovery: Recovery | None = None) -> None:
        self._folder = folder
        self._layout = layout
        self._as_present = as_present
        self._recovery = recovery or Recovery()
        self._next = max((file.number for file in self._files("*")), default=0) + 1
        self._whole: _Whole | None = None  # the last one of this process

    def write(self, snapshot: Snapshot) -> int:
        """Write the newest checkpoint; see `Checkpoints`."""
        path, whole = self._folder / f"{_PREFIX}{self._next:012d}", self._whole
        self._next += 1
        if whole is None or whole.left_bytes <= 0 or not whole.path.exists():
            parts = encoded(snapshot, self._layout)
            write_atomically(path, parts)
            self._whole = _Whole(path, snapshot.copy(), CONTINUED * size_of(parts))
        else:
            parts = changes(whole.snapshot, snapshot)
            write_atomically(path.with_name(f"{path.name}-since-{whole.path.name.removeprefix(_PREFIX)}"), parts)
            whole.left_bytes -= size_of(parts)
        self._drop_old()
        return size_of(parts)

    def _drop_old(self) -> None:
        files, kept = self._files(), set()
        for since in sorted({file.since for file in files})[-KEPT:]:
            of_one = [file for file in files if file.since == since]  # the whole one is the oldest
            kept |= {*of_one[:1], *of_one[-KEPT:]}
        for file in files:
            if file not in kept:
                with suppress(OSError):
                    file.path.unlink()

    def newest(self) -> tuple[Snapshot | None, list[str]]:
        """Return the newest undamaged snapshot; see `Checkpoints`."""
        complaints: list[str] = []
        for file in reversed(self._files()):
            try:
                return self._read(file), complaints
            except UnreadableLayoutError as error:
                complaints.append(f"{file.path.name} is not used: {error}; {_put_aside(file.path)}")
            except _ContinuesNothingError as error:
                complaints.append(f"{file.path.name} is not used: {error}")
            except (OSError, CheckpointError) as error:
                complaints.append(f"{file.path.name} is not used: {error}")
                self._recovery.set_aside(file.path, DAMAGED, INSTEAD, f"{_PREFIX}*")
        return None, complaints

    def _read(self, file: _File) -> Snapshot:
        """Raises OSError and CheckpointError."""
        whole = self._folder / f"{_PREFIX}{file.since:012d}"
        try:
            layout, snapshot = decoded(whole.read_bytes())
        except (OSError, CheckpointError) as error:
            if file.path == whole:
                raise
            raise _ContinuesNothingError(f"{whole.name}, which it continues, cannot be used: {error}") from error
        if file.path != whole:
            snapshot = applied(snapshot, file.path.read_bytes())
        return self._as_present(layout, snapshot)

    def _files(self, prefix: str = "") -> list[_File]:
        """Return the checkpoints, the oldest first."""
        found = [(_NAME.fullmatch(path.name), path) for path in self._folder.glob(f"{prefix}{_PREFIX}*")]
        files = (_File(int(name[1]), int(name[2] or name[1]), path) for name, path in found if name)
        return sorted(files)


def _put_aside(path: Path) -> str:
    """Rename a checkpoint, so that no later one takes its place. Return what became of it, for people."""
    kept = path.with_name(f"unread-{path.name}")
    try:
        path.replace(kept)
    except OSError as error:
        return f"it cannot be kept: {error.strerror}"
    return f"it is kept as {kept.name}"

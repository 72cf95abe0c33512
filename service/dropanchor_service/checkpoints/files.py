"""Write and read checkpoints in a folder, which keeps the last two."""

from contextlib import suppress
from pathlib import Path

from dropanchor_schemas.sentences import say
from dropanchor_service.checkpoints.format import CheckpointError, Decode, Snapshot, UnreadableLayoutError, encoded
from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_service.runtime.recovery import DAMAGED, Recovery

KEPT = 2
_PREFIX = "checkpoint-"
INSTEAD = say("checkpoint_before", "the one before is used, or else all tags start afresh")
_ASIDE = f"unread-{_PREFIX}"


class CheckpointFolder:
    """Checkpoints in a folder, written in one layout. Not thread-safe.

    A checkpoint whose layout `decode` cannot read is kept under another name, and so is one that is damaged, which
    `recovery` reports.
    """

    def __init__(self, folder: Path, layout: str, decode: Decode, recovery: Recovery | None = None) -> None:
        self._folder = folder
        self._layout = layout
        self._decode = decode
        self._recovery = recovery or Recovery()
        self._next = max((_number(path) for path in [*self._files(), *self._files(_ASIDE)]), default=0) + 1

    def write(self, snapshot: Snapshot) -> int:
        """Write the newest checkpoint; see `Checkpoints`."""
        parts = encoded(snapshot, self._layout)
        path = self._folder / f"{_PREFIX}{self._next:012d}"
        self._next += 1
        write_atomically(path, parts)
        for old in self._files()[:-KEPT]:
            with suppress(OSError):
                old.unlink()
        return sum(memoryview(part).nbytes for part in parts)

    def newest(self) -> tuple[Snapshot | None, list[str]]:
        """Return the newest undamaged snapshot; see `Checkpoints`."""
        complaints: list[str] = []
        for path in reversed(self._files()):
            try:
                return self._decode(path.read_bytes()), complaints
            except UnreadableLayoutError as error:
                complaints.append(f"{path.name} is not used: {error}; {_put_aside(path)}")
            except (OSError, CheckpointError) as error:
                complaints.append(f"{path.name} is not used: {error}")
                self._recovery.set_aside(path, DAMAGED, INSTEAD, f"{_PREFIX}*")
        return None, complaints

    def _files(self, prefix: str = _PREFIX) -> list[Path]:
        """Return the checkpoints, the oldest first."""
        found = [path for path in self._folder.glob(f"{prefix}*") if path.name[len(prefix) :].isdecimal()]
        return sorted(found, key=_number)


def _put_aside(path: Path) -> str:
    """Rename a checkpoint, so that no later one takes its place. Return what became of it, for people."""
    kept = path.with_name(f"unread-{path.name}")
    try:
        path.replace(kept)
    except OSError as error:
        return f"it cannot be kept: {error.strerror}"
    return f"it is kept as {kept.name}"


def _number(path: Path) -> int:
    return int(path.name.rpartition("-")[2])

"""Write and read checkpoints in a folder, which keeps the last two."""

from contextlib import suppress
from pathlib import Path

from dropanchor_service.checkpoints.format import CheckpointError, Snapshot, decoded, encoded
from dropanchor_service.runtime.atomic_file import write_atomically

KEPT = 2
_PREFIX = "checkpoint-"


class CheckpointFolder:
    """Checkpoints of one layout in a folder. Not thread-safe.

    template: any snapshot of this layout, for its dtypes.
    """

    def __init__(self, folder: Path, layout: str, template: Snapshot) -> None:
        self._folder = folder
        self._layout = layout
        self._template = template
        self._next = max((_number(path) for path in self._files()), default=0) + 1

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
                return decoded(path.read_bytes(), self._layout, self._template), complaints
            except (OSError, CheckpointError) as error:
                complaints.append(f"{path.name} is not used: {error}")
        return None, complaints

    def _files(self) -> list[Path]:
        """Return the checkpoints, the oldest first."""
        found = [path for path in self._folder.glob(f"{_PREFIX}*") if path.name[len(_PREFIX) :].isdecimal()]
        return sorted(found, key=_number)


def _number(path: Path) -> int:
    return int(path.name[len(_PREFIX) :])

"""Move a damaged SQLite file aside, complete, so that somebody can repair it."""

import sqlite3
from pathlib import Path

_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_MARK = "damaged-"
_COMPANIONS = ("-wal", "-shm", "")  # the file itself last: a kill before that loses no part of it


def is_damage(error: sqlite3.DatabaseError) -> bool:
    """Return whether the content of the file is wrong, rather than the disk or the statement."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGE


def move_aside(path: Path, when: str) -> str:
    """Rename the file and its companions, and return the new name, which contains `when`.

    No connection may have the file open. Raises OSError.
    """
    to = path.with_name(f"{path.name}.{_MARK}{when}")
    for suffix in _COMPANIONS:
        companion = Path(f"{path}{suffix}")
        if companion.exists():
            companion.rename(f"{to}{suffix}")
    return to.name


def damaged_files(path: Path) -> list[Path]:
    """Return the damaged files that were moved aside and still exist."""
    return [found for found in path.parent.glob(f"{path.name}.{_MARK}*") if not found.name.endswith(("-wal", "-shm"))]

"""A SQLite file that is damaged is moved out of the way, whole, for whoever wants to repair it."""

import sqlite3
from pathlib import Path

_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_MARK = "damaged-"
_COMPANIONS = ("-wal", "-shm", "")  # the file itself last: until it is gone, a kill in between changes nothing


def is_damage(error: sqlite3.DatabaseError) -> bool:
    """Whether the content of the file is wrong, and not the disk or the question."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGE


def move_aside(path: Path, when: str) -> str:
    """The file's new name. when: what becomes part of it. Raises OSError. Nobody may have the file open."""
    to = path.with_name(f"{path.name}.{_MARK}{when}")
    for suffix in _COMPANIONS:
        companion = Path(f"{path}{suffix}")
        if companion.exists():
            companion.rename(f"{to}{suffix}")
    return to.name


def set_aside(path: Path) -> list[Path]:
    """The files that were moved aside and are still there."""
    return [found for found in path.parent.glob(f"{path.name}.{_MARK}*") if not found.name.endswith(("-wal", "-shm"))]

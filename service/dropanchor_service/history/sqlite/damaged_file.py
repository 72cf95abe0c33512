"""Find out whether a SQLite file is damaged."""

import sqlite3
import time
from contextlib import closing
from pathlib import Path

from dropanchor_schemas.sentences import say
from dropanchor_service.runtime.recovery import damaged, unreadable

_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_STEPS = 10_000  # of SQLite between two looks at the clock, some ms


def is_damage(error: sqlite3.Error) -> bool:
    """Return whether the content of the file is wrong, rather than the disk or the statement."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGE


def damage_in(path: Path, most_s: float) -> str | None:
    """Return what is wrong with a file; None if there is none, or if nothing was found in this time."""
    try:
        with path.open("rb") as file:
            if not file.read(1):
                return say("is_empty", "is empty")
        return _damage_in_structure(path, time.monotonic() + most_s)
    except FileNotFoundError:
        return None
    except sqlite3.Error as error:  # not checked to its end, or locked: whoever uses it will tell
        return damaged(error) if is_damage(error) else None
    except OSError as error:
        return unreadable(error)


def _damage_in_structure(path: Path, end_s: float) -> str | None:
    """Raises sqlite3.Error."""
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.set_progress_handler(lambda: time.monotonic() > end_s, _STEPS)
        found = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
    return None if found == "ok" else damaged(" ".join(found.split()))

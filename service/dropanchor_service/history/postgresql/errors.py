"""Say in one sentence what is wrong with the database."""

from collections.abc import Iterator
from contextlib import contextmanager

import psycopg
from psycopg import errors

from dropanchor_service.history.errors import HistoryError

_REFUSALS = ("authentication failed", "no password supplied", "no pg_hba.conf entry")


@contextmanager
def explained() -> Iterator[None]:
    """Raise HistoryError in place of errors that an operator can do something about.

    What the database cannot take (psycopg.DataError) would fail for ever, so it stays an error of the program.
    """
    try:
        yield
    except psycopg.DataError:
        raise
    except psycopg.Error as error:
        raise HistoryError(sentence(error)) from error


def sentence(error: psycopg.Error) -> str:
    """Return what is wrong. It names the user at most, never the password."""
    reason = _reason(error)
    match error:
        case errors.DiskFull():
            return f"the disk of the database is full: {reason}"
        case errors.InsufficientPrivilege():
            return f"the user of the database lacks a right: {reason}"
        case errors.ReadOnlySqlTransaction():
            return f"the database can only be read, perhaps it is a standby: {reason}"
        case errors.LockNotAvailable():
            return "another program holds a lock in the database for a long time"
        case errors.QueryCanceled():
            return "the database took too long to answer"
        case _ if any(words in reason for words in _REFUSALS):
            return f"the database refuses the login, check `url` and `password_file` in [history]: {reason}"
        case psycopg.OperationalError():
            return f"the database cannot be reached: {reason}"
        case _:
            return f"the database cannot do it: {reason}"


def _reason(error: psycopg.Error) -> str:
    text = error.diag.message_primary or str(error)
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if not lines:
        return type(error).__name__
    return lines[0].removeprefix("connection failed: ").removeprefix("connection is bad: ")

"""Histories in a file and in a database, and access to the connections that the code under test opens."""

import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.history_places import DatabasePlace, FilePlace, Place, opened
from support.postgresql import Postgresql, needs_postgresql, running_postgresql


@pytest.fixture
def connections(monkeypatch: pytest.MonkeyPatch) -> list[sqlite3.Connection]:
    """Every connection that is opened during the test, in order."""
    opened: list[sqlite3.Connection] = []
    connect = sqlite3.connect

    def recorded(*args: object, **kwargs: object) -> sqlite3.Connection:
        connection: sqlite3.Connection = connect(*args, **kwargs)  # type: ignore[call-overload]
        opened.append(connection)
        return connection

    monkeypatch.setattr(sqlite3, "connect", recorded)
    return opened


@pytest.fixture
def place(tmp_path: Path) -> FilePlace:
    """A history that does not exist yet, in a file."""
    return FilePlace(tmp_path / "h.sqlite")


@pytest.fixture(scope="session")
def postgresql() -> Iterator[Postgresql]:
    """A server for all tests of a session or worker."""
    with running_postgresql() as server:
        yield server


@pytest.fixture(scope="session")
def shared_database(postgresql: Postgresql) -> str:
    """The URL of a database in which each test has sites of its own."""
    return postgresql.new_database()


@pytest.fixture(params=["file", pytest.param("database", marks=(needs_postgresql, pytest.mark.outside))])
def any_place(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Place]:
    """A history that does not exist yet, in a file and then in a database."""
    if request.param == "file":
        yield FilePlace(tmp_path / "h.sqlite")
    else:
        with opened(request.getfixturevalue("shared_database")) as database:
            yield DatabasePlace(database)

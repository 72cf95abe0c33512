"""A database whose tables are empty."""

from collections.abc import Iterator

import pytest

from dropanchor_service.cluster.database import make_tables
from support.postgresql import Postgresql, running_postgresql


@pytest.fixture(scope="session")
def server() -> Iterator[Postgresql]:
    with running_postgresql() as running:
        yield running


@pytest.fixture
def url(server: Postgresql) -> str:
    """Return the address of a new database of a cluster."""
    made = server.new_database()
    with server.connect(made) as connection:
        make_tables(connection)
    return made

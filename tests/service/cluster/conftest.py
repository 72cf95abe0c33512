"""One database for the tests of the cluster; each test has a bucket of its own."""

from collections.abc import Iterator

import pytest

from dropanchor_service.cluster.database import make_tables
from support.postgresql import Postgresql, running_postgresql


@pytest.fixture(scope="session")
def database() -> Iterator[Postgresql]:
    with running_postgresql() as server:
        with server.connect() as connection:
            make_tables(connection)
            make_tables(connection)  # does nothing the second time
        yield server

"""A database of the cluster that is frozen counts as an error: no thread waits for it for ever."""

import pytest

from dropanchor_service.cluster import database as cluster_database
from dropanchor_service.cluster.database import DatabaseError, connect
from support.postgresql import Postgresql


def test_a_statement_to_a_frozen_database_ends_with_an_error(
    database: Postgresql, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_database, "SILENCE_S", 1.0)
    connection = connect(database.url(), "a")
    assert connection.execute("SELECT 1").fetchone() == (1,)
    with database.frozen(), pytest.raises(DatabaseError, match="it has said nothing for 1 s"):
        connection.execute("SELECT 1")
    assert connection.closed

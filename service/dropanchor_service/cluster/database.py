"""The database of a cluster: how to connect to it, and its tables. This module needs the extra `postgresql`."""

from typing import Any

import psycopg
from psycopg.conninfo import make_conninfo

from dropanchor_service.history.postgresql.patience import PatientConnection

Connection = psycopg.Connection[tuple[Any, ...]]
DatabaseError = psycopg.Error

_OPTIONS: dict[str, Any] = {
    "client_encoding": "utf8",
    "connect_timeout": 2,
    "tcp_user_timeout": 3000,
    "keepalives_idle": 1,
    "keepalives_interval": 1,
    "keepalives_count": 2,
}
"""A network that swallows everything counts as an error within seconds."""
SILENCE_S = 15.0  # of a server that is frozen; statements take some ms, and large checkpoints some seconds

_LOCK = 0x64726F70  # of ours, so that two processes do not make the tables at once
_TABLES = """
CREATE TABLE IF NOT EXISTS dropanchor_lease (
    bucket text PRIMARY KEY,
    epoch bigint NOT NULL DEFAULT 0,
    owner text NOT NULL DEFAULT '',
    address text NOT NULL DEFAULT '',
    sites text NOT NULL DEFAULT '',
    renewals bigint NOT NULL DEFAULT 0,
    is_moving boolean NOT NULL DEFAULT false,
    was_moved boolean NOT NULL DEFAULT false,
    takes_any boolean NOT NULL DEFAULT false,
    lease_s double precision NOT NULL DEFAULT 0,
    renewed timestamptz NOT NULL DEFAULT clock_timestamp()
);
ALTER TABLE dropanchor_lease ADD COLUMN IF NOT EXISTS moving_to text NOT NULL DEFAULT '';
ALTER TABLE dropanchor_lease ADD COLUMN IF NOT EXISTS version text NOT NULL DEFAULT '';
CREATE TABLE IF NOT EXISTS dropanchor_checkpoint (
    bucket text PRIMARY KEY,
    epoch bigint NOT NULL,
    layout text NOT NULL DEFAULT '',
    written timestamptz NOT NULL DEFAULT clock_timestamp(),
    content bytea NOT NULL DEFAULT ''
);
ALTER TABLE dropanchor_checkpoint ALTER content SET STORAGE EXTERNAL;
ALTER TABLE dropanchor_checkpoint ADD COLUMN IF NOT EXISTS object text NOT NULL DEFAULT '';
ALTER TABLE dropanchor_checkpoint ADD COLUMN IF NOT EXISTS bytes bigint NOT NULL DEFAULT 0;
CREATE TABLE IF NOT EXISTS dropanchor_document (
    bucket text,
    name text,
    epoch bigint NOT NULL,
    content bytea NOT NULL,
    PRIMARY KEY (bucket, name)
);
CREATE TABLE IF NOT EXISTS dropanchor_standby (
    bucket text,
    name text,
    obstacle text NOT NULL DEFAULT '',
    seen timestamptz NOT NULL DEFAULT clock_timestamp(),
    PRIMARY KEY (bucket, name)
);
ALTER TABLE dropanchor_standby ADD COLUMN IF NOT EXISTS version text NOT NULL DEFAULT '';
ALTER TABLE dropanchor_standby ADD COLUMN IF NOT EXISTS installed text NOT NULL DEFAULT '';
ALTER TABLE dropanchor_standby ADD COLUMN IF NOT EXISTS has_to_end boolean NOT NULL DEFAULT false;
CREATE TABLE IF NOT EXISTS dropanchor_node (
    name text PRIMARY KEY,
    shards integer NOT NULL DEFAULT 0,
    is_drained boolean NOT NULL DEFAULT false,
    seen timestamptz NOT NULL DEFAULT clock_timestamp()
);
"""
"""The content of a checkpoint is numbers, which the database would try to compress in vain."""
_NEWEST = """
    SELECT 1 FROM pg_attribute WHERE attrelid = to_regclass('dropanchor_checkpoint') AND attname = 'bytes'
"""


def connect(url: str, name: str) -> Connection:
    """Return a connection whose statements are transactions of their own. Raises DatabaseError.

    The last commits before a crash of the database may be lost, unless a transaction sets that it waits for the disk.
    """
    conninfo = make_conninfo(url, application_name=f"dropanchor {name}", **_OPTIONS)
    connection = PatientConnection.connect(conninfo, autocommit=True)
    connection.silence_s = SILENCE_S
    try:
        connection.execute("SET synchronous_commit = off")
    except psycopg.Error:
        connection.close()
        raise
    return connection


def make_tables(connection: Connection) -> None:
    """Make the tables and columns that do not exist yet. Raises DatabaseError."""
    with connection.transaction():
        connection.execute("SELECT pg_advisory_xact_lock(%s)", [_LOCK])
        if connection.execute(_NEWEST).fetchone() is None:
            connection.execute(_TABLES)


def sentence_of(error: DatabaseError) -> str:
    """Return an error of the database in one line, without a full stop."""
    text = " ".join((error.diag.message_primary or str(error)).split()).rstrip(".") or type(error).__name__
    if isinstance(error, psycopg.errors.UndefinedColumn | psycopg.errors.UndefinedTable):
        return f"its tables are not those of this version ({text})"
    return text

"""The tables in the database, and their version."""

import logging

from psycopg import Connection, errors

from dropanchor_service.estimation.columns import State
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.postgresql.pose_columns import COLUMNS

SCHEMA = "dropanchor_history"
VERSION = 1
_log = logging.getLogger(__name__)
LOCK = 0x64726F70  # first half of the keys of all advisory locks; 0 as the second half is the schema, others are sites

FENCED = "EXISTS (SELECT FROM epochs e WHERE e.tag = p.tag AND e.epoch > p.epoch AND e.first_ns <= p.t_ns)"
"""Whether a later owner of the tag `p.tag` had begun when this owner wrote the pose `p`."""

_STATES = ", ".join(f"'{state.name.lower()}'" for state in State)
_PLACED = ", ".join(str(int(state)) for state in (State.TRACKING, State.COASTING, State.DEGRADED))
_X, _Y, _HEADING, _SIGMA = (
    f"CASE WHEN NOT p.relative THEN p.{name} END AS {name}" for name in ("x", "y", "heading_rad", "sigma_pos_m")
)
_OF_OWN = ", ".join(f"CASE WHEN p.relative THEN p.{name} END AS relative_{name}" for name in ("x", "y", "heading_rad"))
_VIEW = f"""
CREATE OR REPLACE VIEW tracks AS
    SELECT sites.name AS site, tags.name AS tag, to_timestamp(p.t_ns / 1e9) AS time, p.t_ns,
        CASE WHEN p.relative AND p.state IN ({_PLACED}) THEN 'relative'
            ELSE (ARRAY[{_STATES}])[p.state + 1] END AS state,
        p.relative, {_X}, {_Y}, {_HEADING}, p.speed_mps, {_SIGMA}, {_OF_OWN}
    FROM poses p JOIN tags ON tags.id = p.tag JOIN sites ON sites.id = p.site WHERE NOT {FENCED};
"""
"""A place in a frame of the tag's own has columns of its own, so that nobody takes it for one of the site."""
_HAS_VIEW = "SELECT FROM pg_attribute WHERE attrelid = to_regclass('tracks') AND attname = 'relative_x'"
_CREATE = f"""
CREATE TABLE schema_version (version integer NOT NULL);
INSERT INTO schema_version VALUES ({VERSION});
CREATE TABLE sites (
    id integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY, name text NOT NULL UNIQUE,
    keep_ns bigint NOT NULL, max_bytes bigint NOT NULL
);
CREATE TABLE tags (
    id integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY, site integer NOT NULL REFERENCES sites,
    name text NOT NULL, UNIQUE (site, name)
);
CREATE TABLE anchors (
    id integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY, site integer NOT NULL REFERENCES sites,
    name text NOT NULL, UNIQUE (site, name)
);
CREATE TABLE epochs (tag integer NOT NULL, epoch bigint NOT NULL, first_ns bigint NOT NULL, PRIMARY KEY (tag, epoch));
CREATE TABLE missing (
    site integer NOT NULL, level smallint NOT NULL, from_ns bigint NOT NULL, PRIMARY KEY (site, level, from_ns)
);
CREATE TABLE poses (
    {", ".join(f"{column.name} {column.sql_type} NOT NULL" for column in COLUMNS)},
    PRIMARY KEY (site, tag, t_ns, epoch)
) PARTITION BY RANGE (t_ns);
CREATE INDEX ON poses USING brin (t_ns) WITH (pages_per_range = 32);
CREATE TABLE slots (site integer NOT NULL, t_ns bigint NOT NULL, PRIMARY KEY (site, t_ns)) PARTITION BY RANGE (t_ns);
CREATE TABLE stretches (
    site integer NOT NULL, level smallint NOT NULL, from_ns bigint NOT NULL, epoch bigint NOT NULL,
    summaries bytea NOT NULL, heads bytea NOT NULL, cells bytea NOT NULL, PRIMARY KEY (site, level, from_ns)
) PARTITION BY RANGE (from_ns);
ALTER TABLE stretches ALTER summaries SET STORAGE EXTERNAL, ALTER heads SET STORAGE EXTERNAL,
    ALTER cells SET STORAGE EXTERNAL;
{_VIEW}"""


def is_prepared(connection: Connection) -> bool:
    """Return whether the tables exist. Raises HistoryError when they are of a later version."""
    if connection.execute("SELECT to_regclass(%s)", (f"{SCHEMA}.schema_version",)).fetchone() == (None,):
        return False
    found = connection.execute("SELECT max(version) FROM schema_version").fetchone()
    version = 0 if found is None else found[0]
    if version != VERSION:
        raise HistoryError(
            f"the history in the database has schema version {version}, but this service needs {VERSION}: "
            "update the service, or name another database"
        )
    return True


def prepare(connection: Connection) -> None:
    """Make the tables, unless they exist, and the view, unless it is new. Raises HistoryError when they are of a later
    version."""
    with connection.transaction():
        lock(connection, 0)
        if not is_prepared(connection):
            # The right to make schemas is only needed where the schema does not exist.
            if connection.execute("SELECT FROM pg_namespace WHERE nspname = %s", (SCHEMA,)).fetchone() is None:
                connection.execute(f"CREATE SCHEMA {SCHEMA}")
            connection.execute(_CREATE)
        elif connection.execute(_HAS_VIEW).fetchone() is None:
            _replace_view(connection)


def _replace_view(connection: Connection) -> None:
    """Replace the view of versions before the state `relative`. The tables are the same."""
    try:
        with connection.transaction():
            connection.execute(_VIEW)
    except errors.InsufficientPrivilege:
        _log.warning(
            "the view %s.tracks still shows places of relative poses as if they were of the site: only its owner can "
            "replace it, so start the service once with that role",
            SCHEMA,
        )


def lock(connection: Connection, number: int) -> None:
    """Wait until no other transaction has this lock, and keep it until the end of this one."""
    connection.execute("SELECT pg_advisory_xact_lock(%s, %s)", (LOCK, number))

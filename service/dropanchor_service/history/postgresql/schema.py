"""The tables in the database, and their version."""

from psycopg import Connection

from dropanchor_service.estimation.columns import State
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.postgresql.pose_columns import COLUMNS
from dropanchor_service.runtime.written_by import later_schema

SCHEMA = "dropanchor_history"
VERSION = 2  # 1: without heights
LOCK = 0x64726F70  # first half of the keys of all advisory locks; 0 as the second half is the schema, others are sites

FENCED = "EXISTS (SELECT FROM epochs e WHERE e.tag = p.tag AND e.epoch > p.epoch AND e.first_ns <= p.t_ns)"
"""Whether a later owner of the tag `p.tag` had begun when this owner wrote the pose `p`."""

_STATES = ", ".join(f"'{state.name.lower()}'" for state in State)
_PLACED = ", ".join(str(int(state)) for state in (State.TRACKING, State.COASTING, State.DEGRADED))
_X, _Y, _HEADING, _SIGMA = (
    f"CASE WHEN NOT p.relative THEN p.{name} END AS {name}" for name in ("x", "y", "heading_rad", "sigma_pos_m")
)
_OF_OWN = ", ".join(f"CASE WHEN p.relative THEN p.{name} END AS relative_{name}" for name in ("x", "y", "heading_rad"))
_Z = ", ".join(f"nullif(p.{name}, 'NaN') AS {name}" for name in ("z", "z_std_m"))
_VIEW = f"""
CREATE OR REPLACE VIEW tracks AS
    SELECT sites.name AS site, tags.name AS tag, to_timestamp(p.t_ns / 1e9) AS time, p.t_ns,
        CASE WHEN p.relative AND p.state IN ({_PLACED}) THEN 'relative'
            ELSE (ARRAY[{_STATES}])[p.state + 1] END AS state,
        p.relative, {_X}, {_Y}, {_HEADING}, p.speed_mps, {_SIGMA}, {_OF_OWN}, {_Z}
    FROM poses p JOIN tags ON tags.id = p.tag JOIN sites ON sites.id = p.site WHERE NOT {FENCED};
"""
"""A place in a frame of the tag's own has columns of its own, so that nobody takes it for one of the site."""
_ADD_HEIGHTS = f"""
ALTER TABLE poses ADD COLUMN z real NOT NULL DEFAULT 'NaN', ADD COLUMN z_std_m real NOT NULL DEFAULT 'NaN',
    ADD COLUMN z_source smallint NOT NULL DEFAULT 0;
INSERT INTO missing SELECT site, level, from_ns FROM stretches ON CONFLICT DO NOTHING;
TRUNCATE stretches;
{_VIEW}
UPDATE schema_version SET version = {VERSION};
"""
"""The step from version 1. Summaries have heights, too, and are written again."""
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


def require_current(connection: Connection) -> bool:
    """Return whether there are tables. Raises HistoryError when they are of another version."""
    version = _version(connection)
    if version not in (0, VERSION):
        raise _refusal(version)
    return version == VERSION


def prepare(connection: Connection) -> None:
    """Make the tables, or bring them to this version. Raises HistoryError when they are of a later version."""
    with connection.transaction():
        lock(connection, 0)
        version = _version(connection)
        if version > VERSION:
            raise _refusal(version)
        if version == 0:
            # The right to make schemas is only needed where the schema does not exist.
            if connection.execute("SELECT FROM pg_namespace WHERE nspname = %s", (SCHEMA,)).fetchone() is None:
                connection.execute(f"CREATE SCHEMA {SCHEMA}")
            connection.execute(_CREATE)
        elif version < VERSION:
            connection.execute(_ADD_HEIGHTS)


def _version(connection: Connection) -> int:
    """Return the version of the tables, 0 without any."""
    if connection.execute("SELECT to_regclass(%s)", (f"{SCHEMA}.schema_version",)).fetchone() == (None,):
        return 0
    found = connection.execute("SELECT max(version) FROM schema_version").fetchone()
    return 0 if found is None else int(found[0])


def _refusal(version: int) -> HistoryError:
    if version > VERSION:
        why = later_schema("the history in the database", version, VERSION)
        return HistoryError(f"{why}, or name another database")
    return HistoryError(
        f"the history in the database has schema version {version}, but this service needs {VERSION}: "
        "update the service, or name another database"
    )


def lock(connection: Connection, number: int) -> None:
    """Wait until no other transaction has this lock, and keep it until the end of this one."""
    connection.execute("SELECT pg_advisory_xact_lock(%s, %s)", (LOCK, number))

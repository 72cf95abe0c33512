"""Insert poses of a site into the database: COPY into a table of the connection, and from there to the days."""

from collections.abc import Sequence

import numpy as np
from psycopg import Connection

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.postgresql.pose_columns import CONTENT, NAMES, copied, rows_of
from dropanchor_service.history.records import SLOT_NS

# A table of the connection, because COPY cannot replace a pose that is already stored.
_INCOMING = "CREATE TEMPORARY TABLE IF NOT EXISTS incoming (LIKE poses) ON COMMIT DELETE ROWS"
_COPY = f"COPY incoming ({NAMES}) FROM STDIN (FORMAT BINARY)"
_INSERT = f"""
INSERT INTO poses ({NAMES}) SELECT {NAMES} FROM incoming
ON CONFLICT (site, tag, t_ns, epoch) DO UPDATE SET {", ".join(f"{name} = excluded.{name}" for name in CONTENT)}
"""
_SLOTS = f"INSERT INTO slots SELECT DISTINCT site, t_ns / {SLOT_NS} * {SLOT_NS} FROM incoming ON CONFLICT DO NOTHING"
_BEGIN = """
INSERT INTO epochs (epoch, tag, first_ns) SELECT %s, * FROM unnest(%s::integer[], %s::bigint[])
ON CONFLICT (tag, epoch) DO UPDATE SET first_ns = least(epochs.first_ns, excluded.first_ns)
"""
_SUPERSEDED = """
SELECT min(first_ns) FROM unnest(%s::integer[], %s::bigint[]) AS begun (tag, first_ns)
WHERE EXISTS (SELECT FROM epochs WHERE epochs.tag = begun.tag AND epochs.epoch < %s)
"""


class Insertion:
    """Inserts poses of one site, and remembers numbers of its tags and anchors. Every method raises psycopg.Error.

    Its owner opens the transactions, and makes a new one after an error.
    """

    def __init__(self, site: int, epoch: int) -> None:
        self.site = site
        self._epoch = epoch
        self._numbers: dict[str, dict[str, int]] = {"tags": {}, "anchors": {}}
        self._first_ns: dict[int, int] = {}  # of each tag in this epoch

    def insert(
        self, connection: Connection, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]
    ) -> int | None:
        """Insert poses, and replace those of the same tag and time.

        Returns the time from which poses of an earlier owner are no longer read, None if they were not before.
        """
        tag_numbers = self._numbers_of(connection, "tags", tags)
        rows = rows_of(poses, self.site, tag_numbers, self._numbers_of(connection, "anchors", anchors), self._epoch)
        rows = _last_of_each(rows)
        connection.execute(_INCOMING)
        with connection.cursor() as cursor, cursor.copy(_COPY) as copy:
            copy.write(copied(rows))
        connection.execute(_INSERT)
        connection.execute(_SLOTS)
        return self._note_first(connection, rows)

    def _note_first(self, connection: Connection, rows: Array) -> int | None:
        """Store when the epoch of each tag begins. Return what `insert` returns."""
        numbers, first = np.unique(rows["tag"], return_index=True)  # the rows are in order of time
        begun = {
            number: t_ns
            for number, t_ns in zip(numbers.tolist(), rows["t_ns"][first].tolist(), strict=True)
            if t_ns < self._first_ns.get(number, t_ns + 1)
        }
        if not begun:
            return None
        self._first_ns |= begun
        connection.execute(_BEGIN, (self._epoch, list(begun), list(begun.values())))
        found = connection.execute(_SUPERSEDED, (list(begun), list(begun.values()), self._epoch)).fetchone()
        return None if found is None else found[0]

    def _numbers_of(self, connection: Connection, table: str, names: Sequence[str | None]) -> Array:
        """Return the numbers of these names in `tags` or `anchors`, -1 for None. Add new names."""
        known = self._numbers[table]
        new = [name for name in set(names) if name is not None and name not in known]
        if new:
            add = f"INSERT INTO {table} (site, name) SELECT %s, unnest(%s::text[]) ON CONFLICT DO NOTHING"
            connection.execute(add, (self.site, new))
            sql = f"SELECT name, id FROM {table} WHERE site = %s AND name = ANY (%s)"
            known.update(connection.execute(sql, (self.site, new)).fetchall())
        return np.array([-1 if name is None else known[name] for name in names], np.int64)


def _last_of_each(rows: Array) -> Array:
    """Return the rows ordered by tag and time, the last one of each."""
    ordered = rows[np.lexsort((rows["t_ns"], rows["tag"]))]
    is_last = (ordered["tag"][1:] != ordered["tag"][:-1]) | (ordered["t_ns"][1:] != ordered["t_ns"][:-1])
    last: Array = ordered[np.append(is_last, True)]
    return last

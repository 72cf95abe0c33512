"""Follow which tags are in which zones."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.zones import Zone
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.floors import is_height_known
from dropanchor_service.store.groups import Groups
from dropanchor_service.store.records import take
from dropanchor_service.zones.concerned import concerned
from dropanchor_service.zones.judge import CHANGE, MAX_GAP_NS, PER_PAIR, STAY, Memory, Poses, Zones, judge
from dropanchor_service.zones.modes import PlacedPoses
from dropanchor_service.zones.shapes import joined, table_of

MIN_ROOM = 4096  # changes per call of the kernel


class ZoneChange(NamedTuple):
    """What happened to a tag in a zone. kind: as in CHANGE. flags, entered_ns, seen_ns: its STAY after the change."""

    kind: int
    zone: Zone
    row: int
    pose: Array
    t_ns: int
    since_ns: int
    p: float
    flags: int
    entered_ns: int
    seen_ns: int

    @property
    def left_ns(self) -> int:
        """When a tag with an exit left, or when it was last seen inside, if nothing is known of it in between."""
        unseen = self.seen_ns > 0 and self.since_ns - self.seen_ns > MAX_GAP_NS
        return self.seen_ns if unseen else self.since_ns


class _OfSite:
    """The zones of one site, and its tags."""

    def __init__(self) -> None:
        self.zones: tuple[Zone, ...] = ()
        self.table = table_of(())
        self.groups = Groups()
        self.rows: list[int] = []
        self.names: list[str] = []


class ZoneWatch:
    """The memory of all tags and zones of one or several sites. One thread owns it.

    A tag has a row among those of all sites, and a zone a column among those of its site.
    """

    def __init__(self, sites: int = 1) -> None:
        self._sites = [_OfSite() for _ in range(sites)]
        self._tables: tuple[Zones, list[Zone]] | None = None
        self._rows = 0
        self._memory = _empty(0, 0)

    def __len__(self) -> int:
        """Return how many tags have a row."""
        return self._rows

    @property
    def has_zones(self) -> bool:
        return bool(self._joined()[1])

    def set_zones(self, zones: Sequence[Zone], groups: Groups, site: int = 0) -> None:
        """Replace the zones of a site. Tags stay inside those that keep their id, until a pose shows that they are not.

        site: its index.
        """
        of_site = self._sites[site]
        before = of_site.zones
        of_site.zones, of_site.table, of_site.groups = tuple(zones), table_of(zones), groups
        self._tables = None
        self._grow(self._rows, len(zones))
        rows = np.array(of_site.rows, np.int64)
        self._move_columns(rows, before, of_site.zones)
        self._memory.concerned[rows, : len(zones)] = concerned(of_site.zones, groups, of_site.names)

    def _move_columns(self, rows: Array, before: Sequence[Zone], after: Sequence[Zone]) -> None:
        """Give the stays of these rows the columns of their zones after a change."""
        stays, touched = self._memory.stays, self._memory.touched
        column_of = {zone.id: column for column, zone in enumerate(after)}
        columns = np.array([column_of.get(zone.id, -1) for zone in before], np.int64)
        places, earlier = np.nonzero(touched[rows])
        kept = take(stays, (rows[places], earlier))
        stays[rows[places], earlier], touched[rows[places], earlier] = np.zeros((), STAY), False
        stay_on = columns[earlier] >= 0
        places, later = rows[places][stay_on], columns[earlier][stay_on]
        stays[places, later], touched[places, later] = kept[stay_on], True

    def add_tags(self, names: Sequence[str], sites: Sequence[int] | None = None) -> None:
        """Add tags, whose rows follow those of the earlier ones. sites: of each tag; None: all are of the first."""
        begin, self._rows = self._rows, self._rows + len(names)
        self._grow(self._rows, 0)
        self._memory.sites[begin : self._rows] = 0 if sites is None else sites
        new = defaultdict[int, list[int]](list)
        for row in range(begin, self._rows):
            new[int(self._memory.sites[row])].append(row)
        for site, rows in new.items():
            of_site, added = self._sites[site], [names[row - begin] for row in rows]
            of_site.rows += rows
            of_site.names += added
            self._memory.concerned[rows, : len(of_site.zones)] = concerned(of_site.zones, of_site.groups, added)

    def restore(self, zone: str, row: int, flags: int, since_ns: int) -> None:
        """Take over the STAY of a tag. An unknown zone is ignored."""
        column = self._column(zone, row)
        if column is not None:
            stay = np.zeros((), STAY)
            stay["flags"], stay["since_ns"] = flags, since_ns
            self._memory.stays[row, column], self._memory.touched[row, column] = stay, True

    def forget(self, zone: str, row: int) -> int:
        """Forget that a tag is in a zone. Return when it was last seen there, 0 if that is unknown."""
        column = self._column(zone, row)
        if column is None:
            return 0
        seen_ns = int(self._memory.stays[row, column]["seen_ns"])
        self._memory.stays[row, column], self._memory.touched[row, column] = np.zeros((), STAY), False
        return seen_ns

    def restart_delays(self, row: int) -> None:
        """Let every delay of a tag begin again with its next pose."""
        self._memory.judged_ns[row] = 0

    def concerns(self, zone: str, row: int) -> bool:
        """Return whether this is one of the zones of the tag's site, and concerns the tag."""
        column = self._column(zone, row)
        return column is not None and bool(self._memory.concerned[row, column])

    def judge(self, placed: PlacedPoses) -> Iterable[ZoneChange]:
        """Judge new poses, and yield what has changed, per tag in order."""
        begin, found, (table, zones) = 0, placed.poses, self._joined()
        rows, t_ns, speeds = (np.ascontiguousarray(found[name]) for name in ("row", "t_ns", "speed"))
        z, z_std = np.where(is_height_known(found), found["z"], np.nan), np.ascontiguousarray(found["z_std"])
        poses = Poses(rows, t_ns, speeds, z, z_std, placed.first, placed.modes)
        changes = np.zeros(max(MIN_ROOM, PER_PAIR * self._memory.stays.shape[1]), CHANGE)
        while zones and begin < len(found):
            count, begin = judge(poses, table, self._memory, begin, changes)
            yield from self._named(changes[:count], found, table, zones)

    def _named(self, changes: Array, poses: Array, table: Zones, zones: Sequence[Zone]) -> Iterable[ZoneChange]:
        rows = poses["row"][changes["pose"]]
        stays = self._memory.stays[rows, changes["zone"] - table.sites[self._memory.sites[rows]]]
        after = zip(*(stays[name].tolist() for name in ("flags", "since_ns", "seen_ns")), strict=True)
        for (kind, index, zone, since_ns, p), stay in zip(changes.tolist(), after, strict=True):
            pose = poses[index]
            yield ZoneChange(kind, zones[zone], int(pose["row"]), pose, int(pose["t_ns"]), since_ns, p, *stay)

    def _joined(self) -> tuple[Zones, list[Zone]]:
        """Return the zones of all sites, as columns and as they are."""
        if self._tables is None:
            tables = joined([of_site.table for of_site in self._sites])
            self._tables = tables, [zone for of_site in self._sites for zone in of_site.zones]
        return self._tables

    def _column(self, zone: str, row: int) -> int | None:
        zones = self._sites[self._memory.sites[row]].zones
        return next((column for column, known in enumerate(zones) if known.id == zone), None)

    def _grow(self, rows: int, columns: int) -> None:
        """Make room for so many tags, and zones of one site. The memory is used when it is written."""
        had_rows, had_columns = self._memory.stays.shape
        if rows <= had_rows and columns <= had_columns:
            return
        before = self._memory
        rows = had_rows if rows <= had_rows else max(rows, 2 * had_rows)
        columns = had_columns if columns <= had_columns else max(columns, 2 * had_columns)
        self._memory = _empty(rows, columns)
        self._memory.sites[:had_rows], self._memory.judged_ns[:had_rows] = before.sites, before.judged_ns
        self._memory.concerned[:had_rows, :had_columns] = before.concerned
        self._memory.touched[:had_rows, :had_columns] = before.touched
        inside = np.nonzero(before.touched)
        self._memory.stays[inside] = before.stays[inside]


def _empty(rows: int, columns: int) -> Memory:
    shape = (rows, columns)
    return Memory(
        np.zeros(rows, np.int64),
        np.zeros(rows, np.int64),
        np.zeros(shape, bool),
        np.zeros(shape, STAY),
        np.zeros(shape, bool),
    )

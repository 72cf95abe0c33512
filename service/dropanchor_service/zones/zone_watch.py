"""Follow which tags are in which zones."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.zones import Zone
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.groups import Groups
from dropanchor_service.store.records import enlarged
from dropanchor_service.zones.concerned import concerned
from dropanchor_service.zones.judge import CHANGE, MAX_GAP_NS, PER_PAIR, STAY, Memory, Poses, empty_stays, judge
from dropanchor_service.zones.modes import PlacedPoses
from dropanchor_service.zones.shapes import table_of

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


class ZoneWatch:
    """The memory of all tags and zones. One thread owns it."""

    def __init__(self) -> None:
        self.zones: tuple[Zone, ...] = ()
        self._table = table_of(())
        self._names: list[str] = []
        self._groups = Groups()
        self._stays = empty_stays(0, 0)
        self._touched = np.zeros((0, 0), bool)
        self._concerned = np.ones((0, 0), bool)
        self._judged_ns = np.zeros(0, np.int64)

    def set_zones(self, zones: Sequence[Zone], groups: Groups) -> None:
        """Replace the zones. Tags stay inside those that keep their id, until a pose shows that they are not."""
        before = {zone.id: column for column, zone in enumerate(self.zones)}
        stays, touched = (
            empty_stays(len(self._judged_ns), len(zones)),
            np.zeros((len(self._judged_ns), len(zones)), bool),
        )
        for column, zone in enumerate(zones):
            if zone.id in before:
                stays[:, column] = self._stays[:, before[zone.id]]
                touched[:, column] = self._touched[:, before[zone.id]]
        self.zones, self._table, self._groups = tuple(zones), table_of(zones), groups
        self._stays, self._touched = stays, touched
        self._concerned = concerned(self.zones, groups, self._names)

    def add_tags(self, names: Sequence[str]) -> None:
        """Add tags, whose rows follow those of the earlier ones."""
        self._names += names
        if len(self._names) > len(self._judged_ns):
            rows = max(len(self._names), 2 * len(self._judged_ns))
            self._judged_ns = enlarged(self._judged_ns, rows)
            self._stays = enlarged(self._stays, rows)
            self._touched = enlarged(self._touched, rows)
        self._concerned = np.concatenate([self._concerned, concerned(self.zones, self._groups, names)])

    def restore(self, zone: str, row: int, flags: int, since_ns: int) -> None:
        """Take over the STAY of a tag. An unknown zone is ignored."""
        for column, known in enumerate(self.zones):
            if known.id == zone:
                stay = np.zeros((), STAY)
                stay["flags"], stay["since_ns"] = flags, since_ns
                self._stays[row, column], self._touched[row, column] = stay, True

    def forget(self, zone: str, row: int) -> int:
        """Forget that a tag is in a zone. Return when it was last seen there, 0 if that is unknown."""
        seen_ns = 0
        for column, known in enumerate(self.zones):
            if known.id == zone:
                seen_ns = int(self._stays[row, column]["seen_ns"])
                self._stays[row, column], self._touched[row, column] = np.zeros((), STAY), False
        return seen_ns

    def concerns(self, zone: str, row: int) -> bool:
        """Return whether this is one of the zones, and concerns the tag."""
        return any(known.id == zone and self._concerned[row, column] for column, known in enumerate(self.zones))

    def judge(self, placed: PlacedPoses) -> Iterable[ZoneChange]:
        """Judge new poses, and yield what has changed, per tag in order."""
        begin, found = 0, placed.poses
        rows, t_ns, speeds = (np.ascontiguousarray(found[name]) for name in ("row", "t_ns", "speed"))
        poses = Poses(rows, t_ns, speeds, placed.first, placed.modes)
        memory = Memory(self._judged_ns, self._concerned, self._stays, self._touched)
        changes = np.zeros(max(MIN_ROOM, PER_PAIR * len(self.zones)), CHANGE)
        while self.zones and begin < len(found):
            count, begin = judge(poses, self._table, memory, begin, changes)
            yield from self._named(changes[:count], found)

    def _named(self, changes: Array, poses: Array) -> Iterable[ZoneChange]:
        stays = self._stays[poses["row"][changes["pose"]], changes["zone"]]
        after = zip(*(stays[name].tolist() for name in ("flags", "since_ns", "seen_ns")), strict=True)
        for (kind, index, zone, since_ns, p), stay in zip(changes.tolist(), after, strict=True):
            pose = poses[index]
            yield ZoneChange(kind, self.zones[zone], int(pose["row"]), pose, int(pose["t_ns"]), since_ns, p, *stay)

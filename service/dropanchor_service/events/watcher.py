"""Watch the poses, and turn what happens into events and states."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from dropanchor_schemas.zones import TooCloseRule
from dropanchor_service.answers.columns import aged_poses
from dropanchor_service.events.describe import pair_event, tag_event, zone_event
from dropanchor_service.events.drafts import Draft, StateKey, States, StateValue, Stay
from dropanchor_service.store import HealthTable, LatestPoses, SiteStore, TagTable
from dropanchor_service.zones.items import ZoneItems
from dropanchor_service.zones.judge import INSIDE
from dropanchor_service.zones.modes import placed
from dropanchor_service.zones.pair_watch import PairWatch
from dropanchor_service.zones.tag_watch import FleetState, TagWatch
from dropanchor_service.zones.zone_watch import ZoneWatch

SLOW_NS = 1_000_000_000  # between two looks at the rules for single tags
PAIRS_NS = 400_000_000  # and for pairs, which compare all tags
ACTIVE = StateValue(1, 0)


@dataclass(frozen=True)
class Fleet:
    """What the watcher reads."""

    site: SiteStore
    tags: TagTable
    latest: LatestPoses
    health: HealthTable
    now_ns: Callable[[], int]


class Watcher:
    """Follows zones and rules. One thread owns it, and stores what `turn` adds to `drafts`, `states` and `stays`."""

    def __init__(self, fleet: Fleet, items: ZoneItems, states: Mapping[StateKey, StateValue]) -> None:
        """states: what was stored, so that nothing that is known becomes an event again."""
        self._fleet = fleet
        self._items = items
        self._states = dict(states)
        self._versions: object = None
        self._zones = ZoneWatch()
        self._rules: dict[str, PairWatch | TagWatch] = {}
        self._names: list[str] = []
        self._waiting: dict[str, list[StateKey]] = defaultdict(list)  # states of tags that have no row yet
        for key in states:
            for tag in {key.tag, key.other} - {""}:
                self._waiting[tag].append(key)
        self._pose_version = 0
        self._slow_due_ns = self._pairs_due_ns = 0
        self.drafts: list[Draft] = []
        self.states: States = {}
        self.stays: list[Stay] = []
        self._deleted: frozenset[int] = frozenset()

    @property
    def is_full(self) -> bool:
        """Whether there are more pairs of tags too close to each other than a rule can follow."""
        return any(isinstance(watch, PairWatch) and watch.is_full for watch in self._rules.values())

    def turn(self) -> None:
        """Judge what is new."""
        self._follow_edits()
        self._register_tags()
        self._follow_deletions()
        now_ns = self._fleet.now_ns()
        self._judge_zones(now_ns)
        if self._rules and now_ns >= self._pairs_due_ns:
            self._pairs_due_ns = now_ns + PAIRS_NS
            self._judge_pairs(now_ns)
        if self._rules and now_ns >= self._slow_due_ns:
            self._slow_due_ns = now_ns + SLOW_NS
            self._judge_tags(now_ns)

    def _name_of(self, row: int) -> str:
        return self._names[row]

    def _set(self, key: StateKey, value: StateValue | None) -> None:
        self.states[key] = value
        if value is None:
            self._states.pop(key, None)
        else:
            self._states[key] = value

    def _end(self, key: StateKey, left_ns: int) -> None:
        """End a state. That of a tag in a zone becomes a stay."""
        value = self._states.get(key)
        if value is not None and key.source == "zone":
            self.stays.append(Stay(key.tag, key.item, value.since_ns, max(left_ns, value.since_ns)))
        self._set(key, None)

    def _forget(self, key: StateKey) -> None:
        """End a state for another reason than the tag's way: a tag counts in its zone until it was last seen there."""
        tag = self._fleet.tags.find(key.tag) if key.source == "zone" else None
        is_watched = tag is not None and tag.row < len(self._names)
        seen_ns = self._zones.forget(key.item, tag.row) if tag is not None and is_watched else 0
        self._end(key, seen_ns or self._fleet.now_ns())

    def _follow_deletions(self) -> None:
        deleted = self._fleet.tags.rows.deleted
        if deleted is self._deleted:
            return
        names = {self._names[row] for row in deleted - self._deleted if row < len(self._names)}
        for key in [key for key in self._states if key.source == "zone" and key.tag in names]:
            self._forget(key)
        self._deleted = deleted

    def _follow_edits(self) -> None:
        groups = self._fleet.site.groups
        versions = (*self._items.versions, groups)
        if versions == self._versions:
            return
        zones, rules = self._items.zones.all, self._items.rules.all
        for key in [key for key in self._states if key.item not in (zones if key.source == "zone" else rules)]:
            self._forget(key)
        self._zones.set_zones(list(zones.values()), groups)
        self._rules = {
            name: PairWatch(rule, groups) if isinstance(rule, TooCloseRule) else TagWatch(rule, groups)
            for name, rule in rules.items()
        }
        self._versions = versions
        for key in list(self._states):
            if key.source == "rule":
                self._restore(key)
            else:
                self._forget_unconcerned(key)

    def _forget_unconcerned(self, key: StateKey) -> None:
        tag = self._fleet.tags.find(key.tag)
        if tag is not None and tag.row < len(self._names) and not self._zones.concerns(key.item, tag.row):
            self._forget(key)

    def _register_tags(self) -> None:
        count = len(self._names)
        if len(self._fleet.tags) <= count:
            return
        names = [tag.name for tag in self._fleet.tags.all()[count:]]
        self._names += names
        self._zones.add_tags(names)
        for name in names if self._waiting else ():
            for key in self._waiting.pop(name, ()):
                self._restore(key)

    def _restore(self, key: StateKey) -> None:
        """Give a state back to what watches it, once its tags have rows."""
        value = self._states.get(key)
        tags = [self._fleet.tags.find(name) for name in (key.tag, key.other) if name]
        rows = [tag.row for tag in tags if tag is not None and tag.row < len(self._names)]
        if value is None or len(rows) < len(tags):
            return
        watch = self._rules.get(key.item)
        if key.source == "zone":
            self._zones.restore(key.item, rows[0], value.flags, value.since_ns)
            self._forget_unconcerned(key)
        elif isinstance(watch, PairWatch) and len(rows) == 2:
            watch.restore((rows[0], rows[1]), value.since_ns)
        elif isinstance(watch, TagWatch) and len(rows) == 1:
            watch.restore(rows[0])

    def _judge_zones(self, now_ns: int) -> None:
        self._pose_version, poses = self._fleet.latest.since(self._pose_version)
        poses = poses[poses["row"] < len(self._names)]
        if not self._zones.zones or not len(poses):
            return
        for change in self._zones.judge(placed(poses, self._fleet.tags.age_s(poses, now_ns), self._fleet.latest)):
            key = StateKey("zone", change.zone.id, self._names[change.row])
            if change.flags & INSIDE:
                self._set(key, StateValue(change.flags, change.entered_ns))
            else:
                self._end(key, change.left_ns)
            event = zone_event(change, self._name_of)
            if event is not None:
                self.drafts.append(event)

    def _judge_pairs(self, now_ns: int) -> None:
        watches = [watch for watch in self._rules.values() if isinstance(watch, PairWatch)]
        if not watches:
            return
        poses = self._fleet.latest.since()[1]
        poses = poses[poses["row"] < len(self._names)]
        current = placed(poses, self._fleet.tags.age_s(poses, now_ns), self._fleet.latest)
        for watch in watches:
            for change in watch.judge(current, self._names, now_ns):
                key = StateKey("rule", watch.rule.id, *map(self._name_of, change.rows))
                self._set(key, StateValue(1, change.since_ns) if change.is_close else None)
                if change.is_close:
                    self.drafts.append(pair_event(watch.rule, change, now_ns, self._name_of))

    def _judge_tags(self, now_ns: int) -> None:
        watches = [watch for watch in self._rules.values() if isinstance(watch, TagWatch)]
        if not watches:
            return
        fleet = self._fleet_state(now_ns)
        for watch in watches:
            for change in watch.judge(fleet, self._names, now_ns):
                self._set(StateKey("rule", watch.rule.id, self._names[change.row]), ACTIVE if change.is_on else None)
                if change.is_on:
                    self.drafts.append(tag_event(watch.rule, change, fleet, now_ns, self._name_of))

    def _fleet_state(self, now_ns: int) -> FleetState:
        n = len(self._names)
        state, battery = np.full(n, -1, np.int64), np.full(n, np.nan)
        poses = self._fleet.latest.since()[1]
        poses = poses[poses["row"] < n]
        aged = aged_poses(poses, self._fleet.tags.age_s(poses, now_ns))
        state[aged["row"]] = aged["state"]
        battery[:] = list(self._batteries(n))
        return FleetState(state, battery)

    def _batteries(self, rows: int) -> Iterator[float]:
        for row in range(rows):
            record = self._fleet.health.of(row)
            yield np.nan if record is None else record.values.get("battery_fraction", np.nan)

"""What happens to the tags of one site becomes events, states and stays."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dropanchor_schemas.events import RetractionReason
from dropanchor_schemas.zones import BatteryLowRule, TooCloseRule
from dropanchor_service.estimation.columns import Array
from dropanchor_service.events.describe import pair_event, tag_event, zone_event
from dropanchor_service.events.drafts import (
    Draft,
    Happening,
    StartBegan,
    StartClosed,
    StateKey,
    States,
    StateValue,
    Stay,
)
from dropanchor_service.events.open_alarms import ANY, OpenAlarms
from dropanchor_service.events.open_starts import OpenStarts, verdict_on
from dropanchor_service.store import HealthTable, SiteStore, TagTable
from dropanchor_service.store.starts import StartNews, StartPhase
from dropanchor_service.zones.items import ZoneItems
from dropanchor_service.zones.judge import INSIDE
from dropanchor_service.zones.pair_watch import PairWatch, places_of
from dropanchor_service.zones.tag_watch import FleetState, TagWatch
from dropanchor_service.zones.zone_watch import ZoneChange, ZoneWatch

ACTIVE = StateValue(1, 0)


@dataclass(frozen=True)
class WatchedSite:
    """What the watcher reads of a site.

    states, starts, alarms: what was stored, so that nothing that is known becomes an event again, so that events can be
    retracted, and so that alarms end.
    """

    store: SiteStore
    tags: TagTable
    health: HealthTable
    items: ZoneItems
    states: Mapping[StateKey, StateValue] = field(default_factory=dict)
    starts: Mapping[str, StartBegan] = field(default_factory=dict)
    alarms: Mapping[StateKey, int] = field(default_factory=dict)


class SiteWatch:
    """Follows the states and rules of one site. Its zones are in the `ZoneWatch` of all sites.

    happened, states, stays: what has happened and is not stored yet.
    """

    def __init__(
        self,
        site: WatchedSite,
        zones: ZoneWatch,
        index: int,
        now_ns: Callable[[], int],
        on_change: Callable[[], None],
    ) -> None:
        """index: of the site. on_change: called when there is something to store."""
        self._site = site
        self._tags = site.tags
        self._zones = zones
        self._index = index
        self._now_ns = now_ns
        self._on_change = on_change
        self._states = dict(site.states)
        self._alarms = OpenAlarms(site.items, site.alarms)
        self._versions: object = None
        self._pairs: dict[str, PairWatch] = {}
        self._tag_rules: dict[str, TagWatch] = {}
        self._rows: list[int] = []
        self._names: list[str] = []
        self._places: dict[int, int] = {}  # of each row among those of the site
        self._waiting: dict[str, list[StateKey]] = defaultdict(list)  # states of tags that have no row yet
        self._starts = OpenStarts(site.starts)
        for key in self._states:
            for tag in {key.tag, key.other} - {""}:
                self._waiting[tag].append(key)
        self.happened: list[Happening] = []
        self.states: States = {}
        self.stays: list[Stay] = []

    @property
    def has_pairs(self) -> bool:
        return bool(self._pairs)

    @property
    def has_tag_rules(self) -> bool:
        return bool(self._tag_rules)

    @property
    def is_full(self) -> bool:
        """Whether there are more pairs of tags too close to each other than a rule can follow."""
        return any(watch.is_full for watch in self._pairs.values())

    def follow_edits(self) -> None:
        """Take over the zones, rules and groups if they have changed."""
        groups, items = self._site.store.groups, self._site.items
        versions = (*items.versions, groups)
        if versions == self._versions:
            return
        zones, rules = items.zones.all, items.rules.all
        for key in [key for key in self._states if key.item not in (zones if key.source == "zone" else rules)]:
            self._forget(key)
        for key, flags in self._alarms.lowered().items():
            self._end_alarms(key, flags)
        self._zones.set_zones(list(zones.values()), groups, self._index)
        self._pairs = {n: PairWatch(rule, groups) for n, rule in rules.items() if isinstance(rule, TooCloseRule)}
        self._tag_rules = {n: TagWatch(r, groups) for n, r in rules.items() if not isinstance(r, TooCloseRule)}
        self._versions = versions
        for key in list(self._states):
            if key.source == "rule":
                self._restore(key)
            else:
                self._forget_unconcerned(key)

    def add_tags(self, tags: Sequence[tuple[int, str]]) -> None:
        """Follow these new tags: row and name."""
        for row, name in tags:
            self._places[row] = len(self._rows)
            self._rows.append(row)
            self._names.append(name)
        for _, name in tags if self._waiting else ():
            for key in self._waiting.pop(name, ()):
                self._restore(key)

    def forget_tag(self, name: str) -> None:
        """End the stays and alarms of a tag that was deleted."""
        self._close_start(name)
        for key in [key for key in self._states if name in (key.tag, key.other)]:
            if key.source == "zone":
                self._forget(key)
            self._end_alarms(key, ANY)

    def note(self, change: ZoneChange) -> None:
        """Note what has happened to a tag in a zone."""
        key = StateKey("zone", change.zone.id, self._name_of(change.row))
        self._hang(key.tag)
        if change.flags & INSIDE:
            self._set(key, StateValue(change.flags, change.entered_ns))
        else:
            self._end(key, change.left_ns)
        if (event := zone_event(change, key)) is not None:
            self._happen(event)

    def has_start(self, tag: str) -> bool:
        """Return whether the tag has a start that ranges may still deny, and on which events may hang."""
        return self._starts.of(tag) is not None

    def follow_start(self, news: StartNews, seen_ns: int) -> None:
        """Follow what became of the start of a tag. seen_ns: time of its latest pose."""
        tag = self._name_of(news.row)
        start = self._starts.of(tag)
        if news.phase == StartPhase.CONFIRMED:
            self._starts.confirm(tag, seen_ns)
        elif start is not None and news.phase != StartPhase.RESUMED and news.place != start.place:
            self._close_start(tag, verdict_on(start, news))
        if news.phase == StartPhase.TOLD and news.place:
            self._zones.restart_delays(news.row)
            if not self.has_start(tag):
                self._starts.begin(tag, news, self._zones_of(tag))

    def judge_pairs(self, poses: Array, modes: Array, now_ns: int) -> None:
        """Judge the rules for pairs. poses, modes: POSE and MODE of each tag of this site that has one place."""
        places = places_of(poses, modes, self._site.store.floors)
        for watch in self._pairs.values():
            for change in watch.judge(poses["row"], places, self._name_of, now_ns):
                key = StateKey("rule", watch.rule.id, *map(self._name_of, change.rows))
                self._set(key, StateValue(1, change.since_ns) if change.is_close else None)
                if change.is_close:
                    self._hang(key.tag, key.other)
                    self._happen(pair_event(watch.rule, change, key, now_ns))

    def judge_tags(self, states: Array, now_ns: int) -> None:
        """Judge the rules for single tags. states: by row of any site."""
        fleet = FleetState(states[self._rows], self._batteries())
        for watch in self._tag_rules.values():
            for change in watch.judge(fleet, self._names, now_ns):
                key = StateKey("rule", watch.rule.id, self._names[change.place])
                self._set(key, ACTIVE if change.is_on else None)
                if change.is_on:
                    self._happen(tag_event(watch.rule, change, key, fleet, now_ns))

    def _batteries(self) -> Array:
        if not any(isinstance(watch.rule, BatteryLowRule) for watch in self._tag_rules.values()):
            return np.full(len(self._rows), np.nan)
        records = map(self._site.health.of, self._rows)
        known = [{} if record is None else record.values for record in records]
        return np.array([values.get("battery_fraction", np.nan) for values in known], np.float64)

    def _zones_of(self, tag: str) -> dict[str, StateValue]:
        """Return the zones in which a tag is."""
        zones = self._site.items.zones.all
        return {zone: self._states[key] for zone in zones if (key := StateKey("zone", zone, tag)) in self._states}

    def _hang(self, *tags: str) -> None:
        """Note the starts that an event of these tags hangs on. Call this before the event."""
        self.happened += [start for tag in tags if (start := self._starts.hang(tag)) is not None]

    def _close_start(self, tag: str, retracts: RetractionReason | None = None) -> None:
        """Forget the start of a tag. retracts: why what hangs on it is not true."""
        start = self._starts.close(tag)
        if start is None:
            return
        self.happened.append(StartClosed(tag, self._now_ns(), retracts))
        self._on_change()
        if retracts is not None:
            self._go_back(start)

    def _go_back(self, start: StartBegan) -> None:
        """Give the tag the states of before its start."""
        self.stays = [stay for stay in self.stays if not start.made(stay)]
        row = self._row_of(start.tag)
        for zone in self._site.items.zones.all:
            key, before = StateKey("zone", zone, start.tag), start.inside.get(zone)
            if row is None or self._states.get(key) == before:
                continue
            self._zones.forget(zone, row)
            if before is not None:
                self._zones.restore(zone, row, *before)
            self._set(key, before)
        for key, value in list(self._states.items()):
            if key.item in self._pairs and start.tag in (key.tag, key.other) and value.since_ns >= start.since_ns:
                self._forget_pair(key)

    def _forget_pair(self, key: StateKey) -> None:
        rows = [self._row_of(name) for name in (key.tag, key.other)]
        if rows[0] is not None and rows[1] is not None:
            self._pairs[key.item].forget((rows[0], rows[1]))
        self._set(key, None)

    def _name_of(self, row: int) -> str:
        return self._tags.rows.at(row).name

    def _happen(self, event: Draft) -> None:
        self.happened.append(event)
        if event.alarm is not None:
            self._alarms.begin(event.alarm)

    def _end_alarms(self, key: StateKey, lost: int, t_ns: int | None = None) -> None:
        """End the alarms that hang on flags that a state has lost. t_ns: when; None: now."""
        if (over := self._alarms.end(key, lost, self._now_ns() if t_ns is None else t_ns)) is not None:
            self.happened.append(over)
            self._on_change()

    def _set(self, key: StateKey, value: StateValue | None, t_ns: int | None = None) -> None:
        """Note a new state; None: it ends. t_ns: when; None: now."""
        self._end_alarms(key, ANY if value is None else ~value.flags, t_ns)
        self.states[key] = value
        if value is None:
            self._states.pop(key, None)
        else:
            self._states[key] = value
        self._on_change()

    def _end(self, key: StateKey, left_ns: int) -> None:
        """End a state. That of a tag in a zone becomes a stay."""
        value = self._states.get(key)
        if value is not None and key.source == "zone":
            self.stays.append(Stay(key.tag, key.item, value.since_ns, max(left_ns, value.since_ns)))
        self._set(key, None, left_ns)

    def _forget(self, key: StateKey) -> None:
        """End a state for another reason than the tag's way: a tag counts in its zone until it was last seen there."""
        row = self._row_of(key.tag) if key.source == "zone" else None
        seen_ns = 0 if row is None else self._zones.forget(key.item, row)
        self._end(key, seen_ns or self._now_ns())

    def _row_of(self, name: str) -> int | None:
        """Return the row of a tag that is followed, None for another."""
        tag = self._tags.find(name)
        return tag.row if tag is not None and tag.row < len(self._zones) else None

    def _forget_unconcerned(self, key: StateKey) -> None:
        row = self._row_of(key.tag)
        if row is not None and not self._zones.concerns(key.item, row):
            self._forget(key)

    def _restore(self, key: StateKey) -> None:
        """Give a state back to what watches it, once its tags have rows."""
        value, rows = self._states.get(key), [self._row_of(name) for name in (key.tag, key.other) if name]
        known = [row for row in rows if row is not None]
        if value is None or len(known) < len(rows):
            return
        pair, single = self._pairs.get(key.item), self._tag_rules.get(key.item)
        if key.source == "zone":
            self._zones.restore(key.item, known[0], value.flags, value.since_ns)
            self._forget_unconcerned(key)
        elif pair is not None and len(known) == 2:
            pair.restore((known[0], known[1]), value.since_ns)
        elif single is not None and len(known) == 1:
            single.restore(self._places[known[0]])

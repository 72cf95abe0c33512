"""Zones, rules and events without threads, over a store of poses that the test fills."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dropanchor_schemas.events import Event
from dropanchor_schemas.zones import Circle, EventRule, Zone
from dropanchor_service.estimation.columns import HYPOTHESIS, State, StateReason
from dropanchor_service.events.alarms import OPEN, StoredAlarm, alarms, open_alarms
from dropanchor_service.events.database import VERSION, Database
from dropanchor_service.events.drafts import Draft
from dropanchor_service.events.site_watch import WatchedSite
from dropanchor_service.events.store import EventStore
from dropanchor_service.events.thread import EventThread, Retention
from dropanchor_service.events.watcher import Watcher
from dropanchor_service.store import HealthTable
from dropanchor_service.zones.items import ZoneItems
from support.api import ApiBench, make_api_bench

S = 1_000_000_000
KEEP = Retention(keep_ns=10**18, max_bytes=2**40)


_BACK = (
    "DROP TABLE starts",
    "DROP TABLE changes",
    "DROP TABLE alarms",
)
"""From the version after each to that before."""


def make_older(database: Database, version: int) -> None:
    """Make the file one of an earlier version, and close it."""
    with database.transaction() as connection:
        for step in "; ".join(reversed(_BACK[version - VERSION :])).split("; "):
            connection.execute(step)
        connection.execute(f"PRAGMA user_version = {version}")
    database.close()


def circle(name: str = "dock", x: float = 0.0, y: float = 0.0, radius_m: float = 5.0, **fields: Any) -> Zone:
    return Zone(id=name, shape=Circle(type="circle", x=x, y=y, radius_m=radius_m), **fields)


@dataclass
class EventBench:
    """folder: where everything is stored, None: nowhere. addressees: destinations of each event."""

    folder: Path | None = None
    addressees: Sequence[str] = ()
    poses: ApiBench = field(default_factory=make_api_bench)
    health: HealthTable = field(default_factory=HealthTable)

    def __post_init__(self) -> None:
        self.items = ZoneItems.opened(self.folder)
        self.database = Database(self.folder)
        self.start()

    def start(self) -> None:
        """Start the service's part again, from what is stored."""
        self.store = EventStore(self.database, "yard", self._addressees)
        answers = self.poses.answers
        stored = self.store.states(), self.store.starts(), open_alarms(self.database)
        site = WatchedSite(answers.site, answers.tags, self.health, self.items, *stored)
        self.watcher = Watcher([site], answers.latest, lambda: self.poses.now_ns)
        self.thread = EventThread(self.watcher, [self.store], KEEP, lambda: self.poses.now_ns, 0.1)

    def put(self, *zones: Zone, rules: Sequence[EventRule] = ()) -> None:
        for zone in zones:
            self.items.zones.put(zone.id, zone)
        for rule in rules:
            self.items.rules.put(rule.id, rule)

    def stay(self, seconds: float, *names: str, **pose: Any) -> list[str]:
        """Give the tags this pose every 0.2 s. Return the new events as `type tag`."""
        before = self.store.newest
        for _ in range(round(seconds / 0.2)):
            self.poses.now_ns += S // 5
            if names:
                self.poses.move(*names, **pose)
            self.thread.turn()
        return [f"{event.type.value.removeprefix('dropanchor.')} {event.subject}" for event in self.events(before)]

    def events(self, after: int = 0) -> list[Event]:
        """Return the stored events, checked against the contract."""
        return [Event.model_validate_json(event.body) for event in self.store.after(after, 100_000)]

    def ambiguous(self, seconds: float, name: str, places: Sequence[tuple[float, float, float]]) -> list[str]:
        """Make a tag ambiguous between places (weight, x, y), every 0.2 s."""
        before = self.store.newest
        for _ in range(round(seconds / 0.2)):
            self.poses.now_ns += S // 5
            self.poses.move(
                name, state=State.AMBIGUOUS, reason=StateReason.SEVERAL_MODES, x=places[0][1], y=places[0][2]
            )
            row = self.poses.answers.tags.register(name).row
            hypotheses = np.zeros(len(places), HYPOTHESIS)
            hypotheses["row"], hypotheses["cov"] = row, np.eye(2) * 0.01
            for hypothesis, (weight, x, y) in zip(hypotheses, places, strict=True):
                hypothesis["weight"], hypothesis["x"], hypothesis["y"] = weight, x, y
            self.poses.answers.latest.write(self.poses.answers.latest.row(row)[None], hypotheses)  # type: ignore[index]
            self.thread.turn()
        return [f"{event.type.value.removeprefix('dropanchor.')} {event.subject}" for event in self.events(before)]

    def alarms(self, condition: str = OPEN) -> list[StoredAlarm]:
        return alarms(self.database, condition, 2**62, (), 100)

    def _addressees(self, _: Draft) -> Sequence[str]:
        return self.addressees

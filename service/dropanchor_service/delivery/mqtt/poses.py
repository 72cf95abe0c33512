"""Publish the poses of a site and the tags in its zones as retained messages: always the newest, and none twice."""

import asyncio
import sqlite3
import time
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress

import numpy as np
import orjson

from dropanchor_schemas.destinations import MqttPosesDestination
from dropanchor_schemas.zones import Zone
from dropanchor_service.answers.columns import PoseColumns, columns_of
from dropanchor_service.delivery.channel import Outcome, Verdict
from dropanchor_service.delivery.live_site import LiveSite
from dropanchor_service.delivery.mqtt.broker import AT_ONCE, Access, Broker, Brokers, Message
from dropanchor_service.delivery.mqtt.discovery import configs_of_tag, configs_of_zone
from dropanchor_service.delivery.mqtt.topics import TRACKING, Topics, tag_state, zone_state
from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.records import enlarged

PERIOD_S = 1.0  # between two looks
FULL_PAUSE_S = 0.5  # when more is due than leaves at once: some 500 messages a second, which took 10 % of a core
REFRESH_S = 60.0  # between two messages of a tag that stands still
MAX_CLEAR_S = 2.0

_SENT = np.dtype([("at_s", "f8"), ("t_ns", "i8"), ("state", "i8"), ("zones", "i8"), ("place", "f8", 4)])


class PosesFeed:
    """Knows what the broker holds of one destination.

    is_away: whether the broker could not be reached. pause_s: to the next look.
    """

    def __init__(self, destination: MqttPosesDestination, live: LiveSite, topics: Topics, broker: Broker) -> None:
        self._destination = destination
        self._live = live
        self._topics = topics
        self._broker = broker
        self._connections = 0
        self._sent = np.zeros(0, _SENT)  # by row
        self._rows: Array = np.zeros(0, np.int64)  # of the tags that have a topic
        self._held: dict[str, bytes] = {}  # what the broker holds in all other topics
        self._configs: dict[str, bytes] = {}
        self._configured: tuple[int, int, bytes] | None = None
        self._refused: dict[str, str] = {}  # why, by topic
        self.is_away = False
        self.pause_s = PERIOD_S

    async def publish(self) -> str | None:
        """Publish what is due, as much as may leave at once. Return what went wrong, None if nothing did."""
        try:
            inside = self._inside()
        except sqlite3.Error as error:
            return f"the tags in zones cannot be read: {error}"
        columns = self._columns()
        self._follow_settings(columns)
        others = list(self._others(inside))[:AT_ONCE]
        of_tags = _zones_of_tags(inside)
        due, marks = self._due(columns, of_tags)
        due = due[: AT_ONCE - len(others)]
        messages = [*others, *(self._of_tag(columns, place, of_tags) for place in due.tolist())]
        self.pause_s = FULL_PAUSE_S if len(messages) >= AT_ONCE else min(PERIOD_S, self._destination.interval_s)
        outcomes = await self._broker.send(messages)
        if self._broker.connections != self._connections:
            self._forget()
        is_sent = np.array([outcome.verdict is not Verdict.UNAVAILABLE for outcome in outcomes], bool)
        self._hold([message for message, known in zip(others, is_sent.tolist(), strict=False) if known])
        sent = due[is_sent[len(others) :]]
        self._sent[columns.poses["row"][sent]] = marks[sent]
        self.is_away = not is_sent.all()
        return self._problem(messages, outcomes)

    async def clear(self) -> None:
        """Remove everything from the broker, if it answers soon."""
        topics = [*self._held, *self._topics_of(self._rows)]
        with suppress(TimeoutError):
            async with asyncio.timeout(MAX_CLEAR_S):
                await self._broker.send([_retained(topic, b"") for topic in topics])

    def _columns(self) -> PoseColumns:
        answers, wanted = self._live.answers, self._destination.tags
        tags = [tag for tag in map(answers.tags.find, wanted) if tag is not None] if wanted else None
        return columns_of(answers.rows(tags), answers.site, answers.tags, answers.now_ns())

    def _inside(self) -> list[tuple[Zone, list[str]]]:
        """Return the zones of the destination, and which of its tags are inside. Raises sqlite3.Error."""
        zones, tags = self._destination.zones, frozenset(self._destination.tags)
        found = self._live.events.occupants()
        return [
            (zone, sorted(tag for tag, _ in found.get(zone.id, ()) if not tags or tag in tags))
            for zone in self._live.zones.all.values()
            if not zones or zone.id in zones
        ]

    def _follow_settings(self, columns: PoseColumns) -> None:
        """Follow tags that come and go, names, zones, and where the site is on the Earth."""
        site, rows = self._live.answers.site, columns.poses["row"].astype(np.int64)
        configured = site.version, self._live.zones.version, rows.tobytes()
        if configured == self._configured:
            return
        self._sent = enlarged(self._sent, max(len(self._sent), int(rows.max(initial=-1)) + 1))
        gone = np.setdiff1d(self._rows, rows)
        self._held |= dict.fromkeys(self._topics_of(gone), b"gone")
        for topic in self._topics_of(rows):
            self._held.pop(topic, None)
        is_same_site = self._configured is not None and self._configured[0] == site.version
        self._sent["at_s"][gone if is_same_site else slice(None)] = 0.0
        self._rows, self._configured = rows, configured
        self._configs = {topic: orjson.dumps(what) for topic, what in self._described(columns)}

    def _described(self, columns: PoseColumns) -> Iterator[tuple[str, dict[str, object]]]:
        prefix, has_places = self._destination.discovery, columns.lat is not None
        if prefix:
            for tag in columns.tags:
                yield from configs_of_tag(prefix, self._topics, tag, self._name_of(tag), has_places)
            for zone in self._live.zones.all.values():
                if not self._destination.zones or zone.id in self._destination.zones:
                    yield from configs_of_zone(prefix, self._topics, zone)

    def _others(self, inside: Sequence[tuple[Zone, list[str]]]) -> Iterator[Message]:
        """Yield what the broker does not hold yet of settings and zones, and empty what nobody wants any longer."""
        zones = {self._topics.zone(zone.id): orjson.dumps(zone_state(zone, tags)) for zone, tags in inside}
        wanted = zones | self._configs
        for topic in [*wanted, *(topic for topic in self._held if topic not in wanted)]:
            payload = wanted.get(topic, b"")
            if payload != self._held.get(topic):
                yield _retained(topic, payload)

    def _due(self, columns: PoseColumns, of_tags: Mapping[str, Sequence[Zone]]) -> tuple[Array, Array]:
        """Return the places of the poses that are due, the longest waiting first, and a _SENT for each pose."""
        poses, marks = columns.poses, np.zeros(len(columns.poses), _SENT)
        marks["at_s"], marks["t_ns"] = time.monotonic(), poses["t_ns"]
        marks["state"] = poses["state"].astype(np.int64) * 1000 + poses["reason"]
        marks["zones"] = [hash(tuple(zone.id for zone in of_tags.get(tag, ()))) for tag in columns.tags]
        numbers = np.column_stack([poses[name] for name in ("x", "y", "z", "sigma_pos")])
        marks["place"] = np.nan_to_num(numbers)
        sent, wanted = self._sent[poses["row"]], self._destination
        age_s = marks["at_s"] - sent["at_s"]
        has_changed = (marks["state"] != sent["state"]) | (marks["zones"] != sent["zones"]) | (sent["at_s"] == 0.0)
        has_moved = np.abs(marks["place"] - sent["place"]).max(axis=1, initial=0.0) >= wanted.deadband_m
        may_move = (poses["state"] == TRACKING) & has_moved & (age_s >= wanted.interval_s)
        is_stale = age_s >= max(REFRESH_S, wanted.interval_s)
        due = np.flatnonzero(has_changed | ((marks["t_ns"] != sent["t_ns"]) & (may_move | is_stale)))
        return due[np.argsort(sent["at_s"][due], kind="stable")], marks

    def _of_tag(self, columns: PoseColumns, place: int, of_tags: Mapping[str, Sequence[Zone]]) -> Message:
        tag = columns.tags[place]
        said = tag_state(columns, place, self._name_of(tag), of_tags.get(tag, ()))
        return _retained(self._topics.tag(tag), orjson.dumps(said))

    def _hold(self, others: Sequence[Message]) -> None:
        """Note what the broker holds now in topics other than those of tags."""
        for topic, payload, *_ in others:
            self._held[topic] = payload
            if not payload:
                del self._held[topic]

    def _problem(self, messages: Sequence[Message], outcomes: Sequence[Outcome]) -> str | None:
        """Return why the broker did not take something. What it refuses is said until it takes it."""
        for message, outcome in zip(messages, outcomes, strict=True):
            if outcome.verdict is Verdict.UNAVAILABLE:
                return outcome.detail
            self._refused.pop(message.topic, None)
            if outcome.verdict is Verdict.REFUSED:
                self._refused[message.topic] = outcome.detail
        return next(iter(self._refused.values()), None)

    def _forget(self) -> None:
        """Let everything be sent again: a broker that was away may hold nothing any longer."""
        self._connections = self._broker.connections
        self._sent["at_s"] = 0.0
        self._held = dict.fromkeys(self._held, b"?")

    def _topics_of(self, rows: Array) -> list[str]:
        return [self._topics.tag(tag) for tag in self._live.answers.tags.rows.names(rows.tolist())]

    def _name_of(self, tag: str) -> str:
        return self._live.answers.site.tag_settings(tag).name or tag


@asynccontextmanager
async def open_poses(
    destination: MqttPosesDestination, live: LiveSite, access: Access, brokers: Brokers
) -> AsyncIterator[PosesFeed]:
    """Open the way for the poses of a site. The connection is made with the first look."""
    topics = Topics(destination.prefix, live.answers.site.site.id)
    async with brokers.of_this_loop(access._replace(status=topics.status)) as broker:
        yield PosesFeed(destination, live, topics, broker)


def _retained(topic: str, payload: bytes) -> Message:
    return Message(topic, payload, is_retained=True)


def _zones_of_tags(inside: Sequence[tuple[Zone, Sequence[str]]]) -> dict[str, list[Zone]]:
    zones: dict[str, list[Zone]] = {}
    for zone, tags in inside:
        for tag in tags:
            zones.setdefault(tag, []).append(zone)
    return zones

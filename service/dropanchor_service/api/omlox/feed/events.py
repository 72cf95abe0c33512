"""The topics that follow stored events. A client gets every event that is stored while it is subscribed, in order."""

import uuid
from collections.abc import Iterator
from typing import Any

import orjson

from dropanchor_schemas.zones import EventType
from dropanchor_service.answers.answers import Answer
from dropanchor_service.api.omlox.feed.messages import Params, allows
from dropanchor_service.api.omlox.feed.positions import Project
from dropanchor_service.api.omlox.geojson import collection, feature, fence_feature
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.models import without_nulls
from dropanchor_service.api.omlox.places import iso_ms
from dropanchor_service.events.store import Selection, StoredEvent

MAX_EVENTS = 500  # in one message


class EventFeed:
    """The events that one subscription has not received yet."""

    types: tuple[EventType, ...]
    """Those of this topic. The retraction of one is sent as its opposite: the interface knows nothing else."""

    def __init__(self, hub: Hub, params: Params, project: Project | None = None) -> None:
        """project: returns the projection of GeoJSON; None for plain objects."""
        self._hub = hub
        self._params = params
        self._project = project
        self._position = hub.events.newest
        self._selection = Selection(types=[kind.value for kind in (*self.types, EventType.EVENT_RETRACTED)])

    def payloads(self) -> Iterator[list[Answer]]:
        """Yield the payload of the next message, if one is due. Raises sqlite3.Error; then nothing is lost."""
        newest = self._hub.events.newest
        if self._position == newest:
            return
        stored = self._hub.events.after(self._position, MAX_EVENTS, self._selection)
        last = stored[-1].sequence if stored else newest
        self._position = last if len(stored) == MAX_EVENTS else max(last, newest)  # it may have grown meanwhile
        found = [answer for event in stored if (answer := self._object(event)) is not None]
        if found:
            yield [collection(map(self._feature, found))] if self._project else found

    def _object(self, event: StoredEvent) -> Answer | None:
        """Return the object of an event, None if the client does not want it."""
        body = orjson.loads(event.body)
        if body["type"] not in self.types and body["data"]["retracted_type"] not in self.types:
            return None
        found = self._described(body, body["data"])
        return found if self._wants(found, body) else None

    def _described(self, body: Any, data: Any) -> Answer:
        raise NotImplementedError

    def _wants(self, found: Answer, body: Any) -> bool:
        raise NotImplementedError

    def _feature(self, found: Answer) -> Answer:
        raise NotImplementedError


class FenceEventFeed(EventFeed):
    """Trackables that enter and leave fences."""

    types = (EventType.ZONE_ENTER, EventType.ZONE_EXIT)

    def _described(self, body: Any, data: Any) -> Answer:
        retracts = data.get("retracts")
        entry = EventType.ZONE_ENTER.value == body["type"] or data.get("retracted_type") == EventType.ZONE_EXIT.value
        trackable = str(self._hub.assets.id_of(body["subject"]))
        stored = self._hub.fences.stored(data["zone"])
        own = {"provider_id": body["subject"], "probability": data["probability"], "sequence": body["sequence"]}
        own |= {"retracts": str(uuid.UUID(retracts))} if retracts else {}
        return without_nulls(
            {
                "id": str(uuid.UUID(body["id"])),
                "fence_id": str(self._hub.fences.id_of(data["zone"])),
                "event_type": "region_entry" if entry else "region_exit",
                "trackable_id": trackable,
                "trackables": [trackable],
                "foreign_id": stored.foreign_id,
                "entry_time": iso_ms(data["since_ns"]) if entry else None,
                "exit_time": None if entry else iso_ms(data["t_ns"]),
                "properties": (stored.properties or {}) | {"dropanchor": own},
            }
        )

    def _wants(self, found: Answer, body: Any) -> bool:
        params = self._params
        return (
            allows(params.fence_id, found["fence_id"])
            and allows(params.trackable_id, found["trackable_id"])
            and allows(params.provider_id, body["subject"])
            and allows(params.foreign_id, found.get("foreign_id"))
            and allows(params.event_type, found["event_type"])
            and allows(params.object_type, "trackable")
        )

    def _feature(self, found: Answer) -> Answer:
        assert self._project is not None
        projection = self._project()
        for zone in self._hub.fences.all():
            if str(self._hub.fences.id_of(zone.id)) == found["fence_id"]:
                shape = fence_feature(self._hub.fences.answer(zone, projection))
                return feature(shape["geometry"], shape["properties"] | found)
        return feature(None, found)  # the fence was deleted meanwhile


class CollisionFeed(EventFeed):
    """Trackables that come too close to each other, by the rules of this service."""

    types = (EventType.TAGS_TOO_CLOSE,)

    def _described(self, body: Any, data: Any) -> Answer:
        tags = (body["subject"], data["other_tag"])
        return without_nulls(
            {
                "id": str(uuid.UUID(body["id"])),
                "collision_type": "collision_end" if data.get("retracts") else "collision_start",
                "start_time": iso_ms(data["since_ns"]),
                "collision_time": iso_ms(data["t_ns"]),
                "end_time": iso_ms(data["t_ns"]) if data.get("retracts") else None,
                "collisions": [{"id": str(self._hub.assets.id_of(tag)), "object_type": "trackable"} for tag in tags],
                "center_distance": data["distance_m"],
            }
        )

    def _wants(self, found: Answer, body: Any) -> bool:  # noqa: ARG002 - the object holds all conditions
        params, (one, other) = self._params, [collision["id"] for collision in found["collisions"]]
        either = allows(params.object_id_1, one) and allows(params.object_id_2, other)
        return allows(params.collision_type, found["collision_type"]) and (
            either or (allows(params.object_id_1, other) and allows(params.object_id_2, one))
        )

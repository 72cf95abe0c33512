"""Which tags are inside which fences."""

from collections.abc import Iterable, Mapping
from typing import Any

import shapely

from dropanchor_schemas.zones import Zone
from dropanchor_service.api.omlox.places import Places
from dropanchor_service.api.omlox.projection import Projection
from dropanchor_service.api.routes.events import reading
from dropanchor_service.events.store import EventStore
from dropanchor_service.store.tags import Tag
from dropanchor_service.zones.shapes import vertices_of

_SITE_FRAME = Projection(None)


class Inside:
    """Reads who has entered, and where the tags are."""

    def __init__(self, events: EventStore, places: Places) -> None:
        self._events = events
        self._places = places

    def tags_in(self, zone: Zone, spatial: bool, tags: Mapping[str, Tag]) -> list[Tag]:
        """Return those of the tags that are in a zone. Raises ProblemError.

        spatial: whose location is inside, instead of those that have entered with the certainty of an event.
        """
        if not spatial:
            with reading():
                states = self._events.states()
            inside: Iterable[str] = [key.tag for key in states if (key.source, key.item) == ("zone", zone.id)]
        else:
            locations = self._places.of_tags(list(tags.values()), _SITE_FRAME)
            inside = [location["provider_id"] for location in locations if _covers(zone, location)]
        return [tags[name] for name in inside if name in tags]

    def zones_of(self, tags: Iterable[Tag], spatial: bool, zones: Iterable[Zone]) -> list[Zone]:
        """Return those of the zones in which one of the tags is. Raises ProblemError."""
        names = {tag.name: tag for tag in tags}
        if spatial:
            return [zone for zone in zones if self.tags_in(zone, True, names)]
        with reading():
            states = self._events.states()
        entered = {key.item for key in states if key.source == "zone" and key.tag in names}
        return [zone for zone in zones if zone.id in entered]


def _covers(zone: Zone, location: Mapping[str, Any]) -> bool:
    place = shapely.Point(location["position"]["coordinates"])
    return bool(shapely.Polygon(vertices_of(zone.shape)).covers(place))

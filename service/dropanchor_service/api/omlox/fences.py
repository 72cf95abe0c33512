"""Fences are the zones of this service. Both interfaces show and change the same ones."""

from collections.abc import Sequence
from typing import Any
from uuid import UUID

from pydantic import ValidationError

from dropanchor_schemas.zones import Circle
from dropanchor_schemas.zones import Zone as SiteZone
from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.omlox.ids import fence_id
from dropanchor_service.api.omlox.models import LOCAL, WGS84, without_nulls
from dropanchor_service.api.omlox.own_properties import with_own, without_own
from dropanchor_service.api.omlox.projection import DECIMALS, Projection, projection_of
from dropanchor_service.api.omlox.zones import has_zone, main_zone
from dropanchor_service.api.routes.parameters import saving
from dropanchor_service.store.items import FullError, NamedItems
from dropanchor_service.store.omlox_items import OmloxItems
from dropanchor_service.store.omlox_models import Fence, Point, Polygon
from dropanchor_service.zones.shapes import ShapeError, vertices_of

_KEPT_BY_THE_ZONE = {"id": None, "name": None, "region": None, "radius": None, "crs": None, "zone_id": None}
_OF_THE_ZONE = ("tags", "groups", "enter", "exit", "dwell_s", "speed_mps", "delay_s")
_NOWHERE = Point(type="Point", coordinates=[0.0, 0.0])


class Fences:
    """Any thread may use it."""

    def __init__(self, answers: Answers, zones: NamedItems[SiteZone], items: OmloxItems) -> None:
        self._answers = answers
        self._zones = zones
        self._items = items

    def id_of(self, zone: str) -> UUID:
        """Return the id of the fence that stands for a zone."""
        return fence_id(self._answers.site.site.id, zone)

    def all(self) -> Sequence[SiteZone]:
        """Return the zones behind the fences."""
        return list(self._zones.all.values())

    def find(self, identifier: UUID) -> SiteZone:
        """Return the zone behind a fence. Raises ProblemError."""
        for zone in self._zones.all.values():
            if self.id_of(zone.id) == identifier:
                return zone
        raise ProblemError(Kind.UNKNOWN_FENCE, f"There is no fence with the id {identifier}.")

    def stored(self, zone: str) -> Fence:
        """Return what clients have said about a fence beyond its shape."""
        return self._items.fences.all.get(zone) or Fence(region=_NOWHERE)

    def answer(self, zone: SiteZone, projection: Projection) -> Answer:
        """Return the `Fence` of a zone."""
        stored = self.stored(zone.id)
        own = {"zone": zone.id} | {name: getattr(zone, name) for name in _OF_THE_ZONE}
        local_zone = main_zone(self._answers.site.site) if projection.crs == LOCAL else None
        return without_nulls(
            stored.model_dump(mode="json")
            | {
                "id": str(self.id_of(zone.id)),
                "name": zone.name or zone.id,
                **_region(zone, projection),
                "crs": projection.crs,
                "zone_id": None if local_zone is None else str(local_zone),
                "properties": with_own(stored.properties, own),
            }
        )

    def save(self, name: str, fence: Fence, present: SiteZone | None) -> SiteZone:
        """Save a fence as the zone with this id. present: the zone that it replaces. Raises ProblemError."""
        zone = self._zone(name, fence, present)
        update = _KEPT_BY_THE_ZONE | {"region": _NOWHERE, "properties": without_own(fence.properties)}
        with saving():
            try:
                self._items.fences.put(name, fence.model_copy(update=update))
                self._zones.put(name, zone)
            except FullError as error:
                raise ProblemError(
                    Kind.ITEMS_FULL, f"There are {len(self._zones.all)} zones already. Delete one first."
                ) from error
        return zone

    def delete(self, zone: SiteZone) -> None:
        """Delete the zone behind a fence. Raises ProblemError."""
        with saving():
            for items in (self._zones, self._items.fences):
                if zone.id in items.all:
                    items.remove(zone.id)

    def _zone(self, name: str, fence: Fence, present: SiteZone | None) -> SiteZone:
        values: dict[str, Any] = {} if present is None else present.model_dump()
        try:
            zone = SiteZone.model_validate(
                values
                | {"id": name, "name": "" if fence.name in (None, name) else fence.name, "shape": self._shape(fence)}
            )
            vertices_of(zone.shape)
        except ValidationError as error:
            found = error.errors()[0]
            place = ".".join(str(part) for part in found["loc"])
            raise ProblemError(Kind.INVALID_REQUEST, f"The fence cannot be a zone: {place}: {found['msg']}.") from error
        except ShapeError as error:
            raise ProblemError(Kind.SHAPE_REFUSED, f"body.region: {error}.") from error
        return zone

    def _shape(self, fence: Fence) -> dict[str, Any]:
        """Return the shape of the zone. Raises ProblemError."""
        projection = self._projection(fence)
        if isinstance(fence.region, Point):
            if fence.radius is None:
                raise ProblemError(Kind.SHAPE_REFUSED, "body.radius: a fence around a point needs a radius in m.")
            x, y = _site_points(projection, [fence.region.coordinates])[0]
            return {"type": "circle", "x": x, "y": y, "radius_m": fence.radius}
        return {"type": "polygon", "points": _site_points(projection, _outline(fence.region))}

    def _projection(self, fence: Fence) -> Projection:
        site = self._answers.site.site
        if fence.crs == LOCAL and (fence.zone_id is None or not has_zone(site, fence.zone_id)):
            raise ProblemError(
                Kind.INVALID_REQUEST, "body.zone_id: with the crs local it must be the id of one of /zones."
            )
        return projection_of(site, fence.crs or WGS84)


def _region(zone: SiteZone, projection: Projection) -> Answer:
    shape = zone.shape
    if isinstance(shape, Circle):
        return {"region": projection.point(shape.x, shape.y), "radius": shape.radius_m}
    ring = projection.coordinates(shape.points)
    return {"region": {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}}


def _outline(polygon: Polygon) -> Sequence[Sequence[float]]:
    if len(polygon.coordinates) > 1:
        raise ProblemError(Kind.SHAPE_REFUSED, "body.region: a fence cannot have holes: draw several fences instead.")
    ring = polygon.coordinates[0]
    return ring[:-1] if ring[0][:2] == ring[-1][:2] else ring


def _site_points(projection: Projection, coordinates: Sequence[Sequence[float]]) -> list[list[float]]:
    if projection.crs == WGS84 and any(abs(lon) > 180 or abs(lat) > 90 for lon, lat, *_ in coordinates):
        raise ProblemError(
            Kind.SHAPE_REFUSED, "body.region: EPSG:4326 needs [longitude, latitude] in degrees; for metres set the crs."
        )
    return [[round(value, DECIMALS) for value in point] for point in projection.site_points(coordinates)]

"""The features of a site that OGC API – Features serves: tags, zones, and tracks of a period."""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import shapely
import shapely.geometry

from dropanchor_schemas.pose import TrackingState
from dropanchor_schemas.site import Georeference
from dropanchor_service.answers.answers import Answer
from dropanchor_service.answers.geodesy import lat_lon
from dropanchor_service.answers.many_tracks import many_tracks
from dropanchor_service.api.formats import geojson
from dropanchor_service.api.routes.period import Period, history_of, limits_of
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.zones.shapes import vertices_of

MAX_POINTS = 1000  # of a track

Span = tuple[int | None, int | None]
"""Start and end of a time, UTC in ns, both included; None: without an end."""


class Collection(NamedTuple):
    """features: returns those of a time, with what has no time in all of them."""

    title: str
    description: str
    features: Callable[[SiteParts, Georeference, Span], Iterator[Answer]]


def _tags(parts: SiteParts, _: Georeference, span: Span) -> Iterator[Answer]:
    for pose in parts.answers.pose_list()["poses"]:
        if (span[0] or 0) <= pose["t_ns"] <= (span[1] or pose["t_ns"]):
            yield geojson.feature_of(pose)


def _zones(parts: SiteParts, origin: Georeference, _: Span) -> Iterator[Answer]:
    for zone in parts.events.items.zones.all.values():
        corners = vertices_of(zone.shape)
        ring = _places(origin, *np.append(corners, corners[:1], axis=0).T)
        yield _feature(zone.id, {"type": "Polygon", "coordinates": [ring]}, zone.model_dump(mode="json"))


def _tracks(parts: SiteParts, origin: Georeference, span: Span) -> Iterator[Answer]:
    """Yield a line for each tag through those of its poses that were tracked. Raises HistoryError and TooMuchError."""
    answers = parts.answers
    from_ns, to_ns = limits_of(Period.model_construct(from_ns=span[0], to_ns=span[1]), answers.now_ns())
    found = many_tracks(history_of(answers), answers.site.floors, None, from_ns, to_ns, MAX_POINTS)
    for track in found["tracks"]:
        points = track.pop("points")
        tracked = np.array([state == TrackingState.TRACKING for state in points["state"]], bool)
        line = _places(origin, points["x"][tracked].astype(float), points["y"][tracked].astype(float))
        geometry = {"type": "LineString", "coordinates": line} if len(line) > 1 else None
        yield _feature(track["tag"], geometry, track | {"from_ns": from_ns, "to_ns": to_ns})


COLLECTIONS = {
    "tags": Collection("Tags", "Where each tag is now.", _tags),
    "zones": Collection("Zones", "The zones of the site. They have no time.", _zones),
    "tracks": Collection(
        "Tracks",
        "Where each tag was tracked in a period of up to 31 days, of the history; by default the last hour.",
        _tracks,
    ),
}


def features_of(
    parts: SiteParts, collection: str, span: Span = (None, None), box: shapely.Geometry | None = None
) -> list[Answer]:
    """Return the features of a collection in a time and a box of longitudes and latitudes, in the order of their ids.

    Raises ProblemError, HistoryError and TooMuchError.
    """
    geojson.require_georeference(parts.answers, "OGC API – Features")
    origin = parts.answers.site.site.georeference
    assert origin is not None
    found = COLLECTIONS[collection].features(parts, origin, span)
    return sorted((one for one in found if box is None or _is_in(one["geometry"], box)), key=lambda one: str(one["id"]))


def box_of(text: str) -> shapely.Geometry:
    """Return the box of `bbox`. One whose west is east of its east goes across the antimeridian."""
    numbers = [float(number) for number in text.split(",")]
    west, south, east, north = numbers if len(numbers) == 4 else (*numbers[:2], *numbers[3:5])
    if west <= east:
        return shapely.box(west, south, east, north)
    return shapely.union(shapely.box(west, south, 180.0, north), shapely.box(-180.0, south, east, north))


def _is_in(geometry: Any, box: shapely.Geometry) -> bool:
    return geometry is not None and bool(shapely.geometry.shape(geometry).intersects(box))


def _places(origin: Georeference, x: Any, y: Any) -> list[list[float]]:
    lat, lon = lat_lon(origin, x, y)
    return [[one, other] for one, other in zip(lon.tolist(), lat.tolist(), strict=True) if math.isfinite(one)]


def _feature(name: str, geometry: Answer | None, properties: Answer) -> Answer:
    return {"type": "Feature", "id": name, "geometry": geometry, "properties": properties}

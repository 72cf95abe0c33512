"""omlox zones: one around each anchor, with the site frame as local coordinates.

Poses of one site stay comparable when a tag hears another anchor. Four ground control points around the anchor let
other programs georeference local coordinates.
"""

from collections.abc import Iterator
from uuid import UUID

from dropanchor_schemas.site import Anchor, Site
from dropanchor_service.answers.answers import Answer
from dropanchor_service.api.omlox.ids import zone_id
from dropanchor_service.api.omlox.own_properties import with_own
from dropanchor_service.api.omlox.projection import Projection

CONTROL_M = 50.0
"""Distance of the ground control points from the anchor, along x and along y."""

_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def zone_answers(site: Site, foreign_id: str | None = None) -> Iterator[Answer]:
    """Yield the `Zone` of each anchor. foreign_id: only of the anchor with this id."""
    return (_answer(site, anchor) for anchor in site.anchors if foreign_id in (None, anchor.id))


def main_zone(site: Site) -> UUID | None:
    """Return the id of the zone that local coordinates without an anchor of their own name; None without anchors."""
    return next((zone_id(site.id, anchor.id) for anchor in site.anchors), None)


def has_zone(site: Site, name: str) -> bool:
    """Return whether this is the id of a zone, or of its anchor."""
    return any(name.lower() == str(zone_id(site.id, anchor.id)) or name == anchor.id for anchor in site.anchors)


def anchor_of(site: Site, zone: str) -> str | None:
    """Return the id of the anchor in the middle of a zone, None if there is no zone with this id."""
    return next((anchor.id for anchor in site.anchors if zone == str(zone_id(site.id, anchor.id))), None)


def _answer(site: Site, anchor: Anchor) -> Answer:
    answer = {
        "id": str(zone_id(site.id, anchor.id)),
        "type": "uwb",
        "foreign_id": anchor.id,
        "name": f"Anchor {anchor.id}",
        "site": site.name or site.id,
        "incomplete_configuration": site.georeference is None,
        "properties": with_own(None, {"anchor": anchor.id, "x": anchor.x, "y": anchor.y, "z": anchor.z}),
    }
    if site.georeference is not None:
        projection = Projection(site.georeference)
        corners = [(anchor.x + CONTROL_M * i, anchor.y + CONTROL_M * j) for i, j in _CORNERS]
        pairs = zip(projection.coordinates(corners), corners, strict=True)
        answer["ground_control_points"] = [list(point) for pair in pairs for point in pair]
        answer["position"] = projection.point(anchor.x, anchor.y)
    return answer

"""Turn the shapes of zones into polygons that the kernels can use, and refuse shapes without a meaning."""

import math
from collections.abc import Sequence

import numpy as np
import shapely
from shapely.validation import explain_validity

from dropanchor_schemas.sentences import say
from dropanchor_schemas.zones import Circle, Polygon, Zone
from dropanchor_service.estimation.columns import Array
from dropanchor_service.zones.judge import Zones

MIN_AREA_M2 = 0.01
SAGITTA_M = 0.01  # how far the polygon of a circle may lie off it
MAX_VERTICES = 720


class ShapeError(ValueError):
    """A shape cannot be a zone. The message says what to do."""


def vertices_of(shape: Polygon | Circle) -> Array:
    """Return the corners (n × 2, m), counter-clockwise. Raises ShapeError."""
    if isinstance(shape, Circle):
        return np.array([shape.x, shape.y]) + disc(shape.radius_m)
    polygon = shapely.Polygon(shape.points)
    if polygon.convex_hull.area < MIN_AREA_M2:
        raise ShapeError(
            say(
                "no_area",
                "the corners do not enclose an area: draw at least three corners that are not on one "
                "line, and {area} m²",
                area=MIN_AREA_M2,
            )
        )
    if not polygon.is_valid:
        raise ShapeError(_advice(polygon))
    return np.array(polygon.normalize().exterior.coords)[:-1][::-1].copy()


def disc(radius_m: float) -> Array:
    """Return the corners (n × 2) of a regular polygon around the origin with the area of this disc."""
    n = math.ceil(math.pi / math.sqrt(2 * SAGITTA_M / radius_m)) if radius_m > SAGITTA_M else 16
    n = min(max(n, 16), MAX_VERTICES)
    angle = np.arange(n) * (2 * math.pi / n)
    radius = radius_m * math.sqrt(2 * math.pi / (n * math.sin(2 * math.pi / n)))
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _advice(polygon: shapely.Polygon) -> str:
    reason = explain_validity(polygon)
    place = reason[reason.find("[") + 1 : reason.find("]")].replace(" ", ", ") if "[" in reason else "an edge"
    if reason.startswith(("Self-intersection", "Ring Self-intersection")):
        return say(
            "edges_cross",
            "the edges cross or touch each other near ({place}): put the corners in the order of a "
            "walk around the area, or draw two zones",
            place=place,
        )
    return say(
        "not_simple",
        "the polygon is not a simple area ({reason}): draw it again, without repeated corners",
        reason=reason,
    )


def table_of(zones: Sequence[Zone]) -> Zones:
    """Return the columns of these zones."""
    shapes = [vertices_of(zone.shape) for zone in zones]
    lengths = [len(shape) for shape in shapes]
    return Zones(
        np.concatenate([np.empty((0, 2)), *shapes]),
        np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        np.array([[*shape.min(axis=0), *shape.max(axis=0)] for shape in shapes]).reshape(-1, 4),
        np.array([-math.inf if zone.z_min_m is None else zone.z_min_m for zone in zones], np.float64),
        np.array([math.inf if zone.z_max_m is None else zone.z_max_m for zone in zones], np.float64),
        np.array([zone.delay_s * 1e9 for zone in zones], np.int64),
        np.array([-1 if zone.dwell_s is None else zone.dwell_s * 1e9 for zone in zones], np.int64),
        np.array([math.inf if zone.speed_mps is None else zone.speed_mps for zone in zones], np.float64),
        np.array([0, len(zones)], np.int64),
    )


def joined(tables: Sequence[Zones]) -> Zones:
    """Return the columns of the zones of several sites, from those of each."""
    corners = np.cumsum([0, *(len(table.vertices) for table in tables)])
    firsts = [table.first[:-1] + begin for table, begin in zip(tables, corners[:-1], strict=True)]
    return Zones(
        np.concatenate([table.vertices for table in tables]),
        np.concatenate([*firsts, corners[-1:]]),
        np.concatenate([table.boxes for table in tables]),
        np.concatenate([table.low for table in tables]),
        np.concatenate([table.high for table in tables]),
        np.concatenate([table.delay_ns for table in tables]),
        np.concatenate([table.dwell_ns for table in tables]),
        np.concatenate([table.speed for table in tables]),
        np.cumsum([0, *(len(table.boxes) for table in tables)]),
    )

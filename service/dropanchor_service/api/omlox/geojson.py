"""omlox objects as GeoJSON."""

from collections.abc import Iterable
from typing import Any

from dropanchor_service.answers.answers import Answer


def feature(geometry: Any, properties: Answer) -> Answer:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def collection(features: Iterable[Answer]) -> Answer:
    return {"type": "FeatureCollection", "features": list(features)}


def location_feature(location: Answer) -> Answer:
    """Return a location as a Feature: its position, and all its other fields as properties."""
    return feature(location["position"], _without(location, "position"))


def motion_feature(motion: Answer) -> Answer:
    """Return a motion as a Feature at the position of its location."""
    location = motion["location"]
    return feature(location["position"], motion | {"location": _without(location, "position")})


def fence_feature(fence: Answer) -> Answer:
    """Return a fence as a Feature; a circle is a Point with a `radius`."""
    return feature(fence["region"], _without(fence, "region"))


def _without(values: Answer, name: str) -> Answer:
    return {key: value for key, value in values.items() if key != name}

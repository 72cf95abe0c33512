"""Poses as GeoJSON (RFC 7946, WGS 84), and the choice between it and plain JSON."""

import re
from typing import Any

from fastapi import Request

from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.api.http.errors import Kind, ProblemError

MEDIA_TYPE = "application/geo+json"
JSON = "application/json"

_WEIGHT = re.compile(r"0(\.[0-9]{0,3})?|1(\.0{0,3})?")


def wanted(request: Request, answers: Answers) -> bool:
    """Whether the client would rather have GeoJSON than JSON. Raises ProblemError when neither can be given."""
    accept = request.headers.get("accept", "*/*")
    if accept in ("*/*", JSON):
        return False
    as_json, as_geojson = quality(accept, JSON), quality(accept, MEDIA_TYPE)
    if as_json == as_geojson == 0:
        raise ProblemError(Kind.NOT_ACCEPTABLE, f"{JSON} and {MEDIA_TYPE} are offered.")
    if as_geojson <= as_json:
        return False
    require_georeference(answers, "GeoJSON")
    return True


def require_georeference(answers: Answers, form: str) -> None:
    """Raises ProblemError where the site has none."""
    if answers.site.site.georeference is None:
        raise ProblemError(
            Kind.NOT_GEOREFERENCED,
            f"{form} holds WGS 84 coordinates only: set `georeference` with PUT /api/v1/site, or accept "
            "application/json for poses in the site frame.",
        )


def feature_of(pose: Answer) -> Answer:
    geometry: Any = None
    if pose["lat"] is not None and pose["lat"] == pose["lat"]:  # NaN: the position is unknown
        geometry = {"type": "Point", "coordinates": [pose["lon"], pose["lat"]]}
    properties = {name: value for name, value in pose.items() if name not in ("lat", "lon")}
    return {"type": "Feature", "id": pose["tag"], "geometry": geometry, "properties": properties}


def collection_of(pose_list: Answer) -> Answer:
    features = [feature_of(pose) for pose in pose_list["poses"]]
    return {"type": "FeatureCollection", "t_ns": pose_list["t_ns"], "features": features}


def quality(accept: str, media_type: str) -> float:
    """The q of RFC 9110, section 12.5.1: the most specific range that matches counts; 0: not wanted."""
    ranges = {_first(part): _q(part) for part in accept.split(",")}
    for candidate in (media_type, f"{media_type.partition('/')[0]}/*", "*/*"):
        if candidate in ranges:
            return ranges[candidate]
    return 0.0


def _first(part: str) -> str:
    return part.split(";")[0].strip().lower()


def _q(part: str) -> float:
    for parameter in part.split(";")[1:]:
        name, _, value = parameter.partition("=")
        if name.strip().lower() == "q":
            return float(value) if _WEIGHT.fullmatch(value.strip()) else 0.0
    return 1.0

"""Poses as GeoJSON (RFC 7946, WGS 84), and content negotiation between GeoJSON and JSON."""

import math
import re

from fastapi import Request

from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.api.http.errors import Kind, ProblemError

MEDIA_TYPE = "application/geo+json"
JSON = "application/json"

_WEIGHT = re.compile(r"0(\.[0-9]{0,3})?|1(\.0{0,3})?")


def is_preferred(request: Request, answers: Answers, told: str | None) -> bool:
    """Return whether the client prefers GeoJSON to JSON. told: `json` or `geojson` where the address says it.

    Raises ProblemError when it accepts neither, or prefers GeoJSON and the site has no georeference.
    """
    accept = {None: request.headers.get("accept", "*/*"), "json": JSON, "geojson": MEDIA_TYPE}[told]
    if accept in ("*/*", JSON):
        return False
    as_json, as_geojson = quality(accept, JSON), quality(accept, MEDIA_TYPE)
    if as_json == as_geojson == 0:
        raise ProblemError(Kind.NOT_ACCEPTABLE, f"The service offers {JSON} and {MEDIA_TYPE}.")
    if as_geojson <= as_json:
        return False
    require_georeference(answers, "GeoJSON")
    return True


def require_georeference(answers: Answers, form: str) -> None:
    """Raise ProblemError when the site has no georeference. form: the format that needs one."""
    if answers.site.site.georeference is None:
        raise ProblemError(
            Kind.NOT_GEOREFERENCED,
            f"{form} holds only WGS 84 coordinates. Set `georeference` of the site, or request "
            "application/json for poses in the site frame.",
        )


def feature_of(pose: Answer) -> Answer:
    """Return a pose as a Feature; `geometry` is null while the position is unknown."""
    return {"type": "Feature", "id": pose["tag"], "geometry": point_of(pose), "properties": pose}


def point_of(pose: Answer) -> Answer | None:
    """Return the Point of a pose, with its altitude if that is known; None while the position is unknown."""
    place = [pose[name] for name in ("lon", "lat", "alt_m") if is_known(pose.get(name))]
    return {"type": "Point", "coordinates": place} if len(place) >= 2 else None


def is_known(value: float | None) -> bool:
    """Return whether a number of an answer is neither null nor NaN."""
    return value is not None and math.isfinite(value)


def collection_of(pose_list: Answer) -> Answer:
    """Return a list of poses as a FeatureCollection."""
    features = [feature_of(pose) for pose in pose_list["poses"]]
    return {"type": "FeatureCollection", "t_ns": pose_list["t_ns"], "features": features}


def quality(accept: str, media_type: str) -> float:
    """Return the q value of a media type in an `Accept` header; 0 when it is not acceptable.

    The most specific range that matches counts (RFC 9110, section 12.5.1).
    """
    ranges = {_media_range(part): _q(part) for part in accept.split(",")}
    for candidate in (media_type, f"{media_type.partition('/')[0]}/*", "*/*"):
        if candidate in ranges:
            return ranges[candidate]
    return 0.0


def _media_range(part: str) -> str:
    return part.split(";")[0].strip().lower()


def _q(part: str) -> float:
    for parameter in part.split(";")[1:]:
        name, _, value = parameter.partition("=")
        if name.strip().lower() == "q":
            return float(value) if _WEIGHT.fullmatch(value.strip()) else 0.0
    return 1.0

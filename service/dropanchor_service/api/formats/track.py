"""Pages of a track as JSON, GeoJSON, CSV, GPX or KML."""

import csv
import io
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any
from xml.sax.saxutils import escape

from fastapi import Request

from dropanchor_service.answers.answers import to_json
from dropanchor_service.answers.track_pages import TrackPage
from dropanchor_service.api.formats import geojson, kml
from dropanchor_service.api.formats.placed import is_apart, placed, utc
from dropanchor_service.api.http.errors import Kind, ProblemError

JSON, GEOJSON, CSV, GPX, KML = "json", "geojson", "csv", "gpx", "kml"
MEDIA_TYPES = {
    JSON: "application/json",
    GEOJSON: "application/geo+json",
    CSV: "text/csv",
    GPX: "application/gpx+xml",
    KML: "application/vnd.google-earth.kml+xml",
}
GEOREFERENCED = {GEOJSON: "GeoJSON", GPX: "GPX", KML: "KML"}

NESTED = ("covariance", "relative_pose")
COVARIANCES = {"var_x": (0, 0), "cov_xy": (0, 1), "cov_xh": (0, 2), "var_y": (1, 1), "cov_yh": (1, 2), "var_h": (2, 2)}
_OF_RELATIVE = ("x", "y", "heading_rad", "p_mode", "sigma_pos_m")
RELATIVES = [f"relative_{name}" for name in (*_OF_RELATIVE, *COVARIANCES)]
"""Columns of a `RelativePose` in a table: never those of the site frame, so that nobody takes one for the other."""

Head = Mapping[str, Any]
"""The members of `Track` except its poses."""


def negotiate(request: Request, requested: str | None) -> str:
    """Return the requested format, or else the one that the `Accept` header prefers. Raises ProblemError."""
    if requested is not None:
        return requested
    accept = request.headers.get("accept", "*/*")
    best = max(MEDIA_TYPES, key=lambda name: geojson.quality(accept, MEDIA_TYPES[name]))  # the first one on a tie
    if geojson.quality(accept, MEDIA_TYPES[best]) == 0:
        raise ProblemError(Kind.NOT_ACCEPTABLE, f"The service offers {', '.join(MEDIA_TYPES.values())}.")
    return best


def encode(page: TrackPage, head: Head, form: str) -> bytes:
    """Return the page in the format `form`."""
    return b"".join(stream([page], head, form))


def stream(pages: Iterable[TrackPage], head: Head, form: str) -> Iterator[bytes]:
    """Yield one document in the format `form` that holds all pages."""
    return _WRITERS[form](pages, head)


def _json(pages: Iterable[TrackPage], head: Head) -> Iterator[bytes]:
    return _document(head, "poses", (page.rows() for page in pages))


def _geojson(pages: Iterable[TrackPage], head: Head) -> Iterator[bytes]:
    features = ([_feature(pose) for pose in page.rows()] for page in pages)
    return _document({"type": "FeatureCollection", **head}, "features", features)


def _document(head: Head, name: str, parts: Iterable[list[dict[str, Any]]]) -> Iterator[bytes]:
    """Yield a JSON object with the members of `head` and one array that holds all parts."""
    yield to_json(head)[:-1] + f',"{name}":['.encode()
    separator = b""
    for part in parts:
        if part:
            yield separator + to_json(part)[1:-1]
            separator = b","
    yield b"]}"


def _feature(pose: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geojson.point_of(pose), "properties": pose}


def _csv(pages: Iterable[TrackPage], head: Head) -> Iterator[bytes]:  # noqa: ARG001 - a table has no place for the head
    for number, page in enumerate(pages):
        names = [name for name in page.columns if name not in NESTED]
        text = io.StringIO(newline="")
        writer = csv.writer(text)
        if number == 0:
            writer.writerow([*names, *COVARIANCES, *RELATIVES])
        for pose in page.rows():
            numbers = [*covariances_of(pose["covariance"]), *relatives_of(pose["relative_pose"])]
            writer.writerow([_cell(value) for value in (*(pose[name] for name in names), *numbers)])
        yield text.getvalue().encode()


def covariances_of(covariance: list[list[float]] | None) -> list[float]:
    """Return the values of the columns COVARIANCES, NaN where unknown."""
    return [math.nan if covariance is None else covariance[i][j] for i, j in COVARIANCES.values()]


def relatives_of(pose: dict[str, Any] | None) -> list[float]:
    """Return the values of the columns RELATIVES from a `RelativePose`, NaN where unknown."""
    if pose is None:
        return [math.nan] * len(RELATIVES)
    return [*(pose[name] for name in _OF_RELATIVE), *covariances_of(pose["covariance"])]


def _cell(value: Any) -> Any:
    """Return a value, and an empty cell for an unknown number, which is null in JSON."""
    return "" if isinstance(value, float) and not math.isfinite(value) else value


def _gpx(pages: Iterable[TrackPage], head: Head) -> Iterator[bytes]:
    """Yield a GPX 1.1 document.

    GPX cannot express uncertainty. So `type` holds the state of a pose, and ambiguous poses are left out.
    """
    yield b'<?xml version="1.0" encoding="UTF-8"?>\n'
    yield b'<gpx version="1.1" creator="Dropanchor" xmlns="http://www.topografix.com/GPX/1/1">\n'
    yield f"<trk><name>{escape(head['tag'])}</name><trkseg>\n".encode()
    last_ns = None
    for page in pages:
        points = placed(page)
        times = [last_ns, *(pose["t_ns"] for pose in points)]
        yield "".join(map(_gpx_point, points, times)).encode()
        last_ns = times[-1]
    yield b"</trkseg></trk></gpx>\n"


def _gpx_point(pose: dict[str, Any], last_ns: int | None) -> str:
    """Return a point, in a new segment if it comes long after the one of `last_ns`."""
    elevation = f"<ele>{pose['alt_m']:.3f}</ele>" if geojson.is_known(pose.get("alt_m")) else ""
    point = f'<trkpt lat="{pose["lat"]:.9f}" lon="{pose["lon"]:.9f}">{elevation}<time>{utc(pose["t_ns"])}</time>'
    return ("</trkseg><trkseg>\n" if is_apart(pose, last_ns) else "") + f"{point}<type>{pose['state']}</type></trkpt>\n"


_WRITERS: Mapping[str, Callable[[Iterable[TrackPage], Head], Iterator[bytes]]] = {
    JSON: _json,
    GEOJSON: _geojson,
    CSV: _csv,
    GPX: _gpx,
    KML: kml.stream,
}

"""Tracks as KML 2.2 with the extension of Google for positions over time.

A `gx:Track` has all of its times before its positions. So each page has its own, which begins with the last position
of the page before, and no page waits for the next one.
https://developers.google.com/kml/documentation/kmlreference#gxtrack
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from xml.sax.saxutils import escape

from dropanchor_service.answers.track_pages import TrackPage
from dropanchor_service.api.formats.geojson import is_known
from dropanchor_service.api.formats.placed import is_apart, placed, utc

_NAMESPACES = 'xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"'

Poses = list[dict[str, Any]]


def stream(pages: Iterable[TrackPage], head: Mapping[str, Any]) -> Iterator[bytes]:
    """Yield a KML document. Poses that are not at one place are left out: KML cannot express uncertainty."""
    yield f'<?xml version="1.0" encoding="UTF-8"?>\n<kml {_NAMESPACES}>\n'.encode()
    yield f"<Placemark><name>{escape(head['tag'])}</name><gx:MultiTrack>\n".encode()
    last: Poses = []
    for page in pages:
        poses = placed(page)
        for segment in _segments(last + poses):
            if segment != last:
                yield _track(segment).encode()
        last = poses[-1:] or last
    yield b"</gx:MultiTrack></Placemark>\n</kml>\n"


def _segments(poses: Poses) -> Iterator[Poses]:
    """Yield the poses between gaps."""
    begin = 0
    for place in range(1, len(poses)):
        if is_apart(poses[place], poses[place - 1]["t_ns"]):
            yield poses[begin:place]
            begin = place
    if poses:
        yield poses[begin:]


def _track(poses: Poses) -> str:
    """Return a track, which lies on the ground unless all altitudes are known."""
    above = all(is_known(pose.get("alt_m")) for pose in poses)
    times = "".join(f"<when>{utc(pose['t_ns'])}</when>\n" for pose in poses)
    places = "".join(f"<gx:coord>{_place(pose, above)}</gx:coord>\n" for pose in poses)
    mode = "absolute" if above else "clampToGround"
    return f"<gx:Track><altitudeMode>{mode}</altitudeMode>\n{times}{places}</gx:Track>\n"


def _place(pose: dict[str, Any], above: bool) -> str:
    altitude = pose["alt_m"] if above else 0.0
    return f"{pose['lon']:.9f} {pose['lat']:.9f} {altitude:.3f}"

"""Poses and anchors as messages that viewers draw."""

import math
from collections.abc import Iterator

import numpy as np

from dropanchor_schemas.keys import chunk_from_id
from dropanchor_service.answers.answers import to_json
from dropanchor_service.answers.columns import REASONS, STATES
from dropanchor_service.answers.geodesy import lat_lon
from dropanchor_service.answers.track_pages import ESTIMATED
from dropanchor_service.estimation.columns import Array
from dropanchor_service.recording import schemas
from dropanchor_service.store.site import SiteDocument

FRAME = "site"
SITE_TOPIC = "/site"
ESTIMATE = "estimate"  # the last part of a topic
NO_TURN = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
KNOWN_COVARIANCE = 3  # foxglove.LocationFix.position_covariance_type

Message = tuple[str, str, bytes]
"""Topic, name of the schema, JSON."""


def topic_of(tag: str, leaf: str) -> str:
    return f"/tag/{chunk_from_id(tag)}/{leaf}"


def site_messages(document: SiteDocument, t_ns: int) -> Iterator[Message]:
    """The document, which a replay needs, and where the anchors are, for the eye."""
    yield SITE_TOPIC, schemas.SITE, document.model_dump_json().encode()
    for anchor in document.site.anchors:
        transform = {
            "timestamp": _stamp(t_ns),
            "parent_frame_id": FRAME,
            "child_frame_id": f"anchor/{anchor.id}",
            "translation": {"x": anchor.x, "y": anchor.y, "z": anchor.z},
            "rotation": NO_TURN,
        }
        yield "/tf", schemas.TRANSFORM, to_json(transform)


def pose_messages(pose: Array, tag: str, anchor: str | None, document: SiteDocument) -> Iterator[Message]:
    """pose: POSE (0-d). What is not known is not drawn."""
    stamp = _stamp(int(pose["t_ns"]))
    yield topic_of(tag, ESTIMATE), schemas.ESTIMATE, to_json(_estimate(pose, anchor))
    x, y, heading = (float(pose[name]) for name in ("x", "y", "heading"))
    if not math.isfinite(x + y):
        return
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(heading / 2), "w": math.cos(heading / 2)}
    settings = document.tags.get(tag)
    placed = {
        "position": {"x": x, "y": y, "z": 0.0 if settings is None else settings.height_m},
        "orientation": turn if math.isfinite(heading) else NO_TURN,
    }
    in_frame = {"timestamp": stamp, "frame_id": FRAME, "pose": placed}
    yield topic_of(tag, "pose"), schemas.POSE, to_json(in_frame)
    if document.site.georeference is not None:
        yield topic_of(tag, "location"), schemas.LOCATION, to_json({"timestamp": stamp} | _location(pose, document))


def _estimate(pose: Array, anchor: str | None) -> dict[str, object]:
    """What is not known is left out."""
    said: dict[str, object] = {
        "t_ns": int(pose["t_ns"]),
        "state": STATES[pose["state"]],
        "reason": REASONS[pose["reason"]],
    }
    numbers = {name: float(pose[field]) for name, field in ESTIMATED.items()}
    said |= {name: value for name, value in numbers.items() if math.isfinite(value)}
    if np.isfinite(pose["cov"]).all():
        said["covariance"] = pose["cov"].reshape(-1).tolist()
    return said if anchor is None else said | {"anchor": anchor}


def _location(pose: Array, document: SiteDocument) -> dict[str, object]:
    """The covariance is of east, north and up; up is not estimated."""
    assert document.site.georeference is not None
    lat, lon = lat_lon(document.site.georeference, pose["x"], pose["y"])
    turn = document.site.georeference.rotation_rad
    east_from_x = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    spread = np.zeros((3, 3))
    spread[:2, :2] = east_from_x @ pose["cov"][:2, :2] @ east_from_x.T
    known = bool(np.isfinite(spread).all())
    return {
        "frame_id": FRAME,
        "latitude": float(lat),
        "longitude": float(lon),
        "altitude": 0.0,
        "position_covariance": spread.reshape(-1).tolist() if known else [0.0] * 9,
        "position_covariance_type": KNOWN_COVARIANCE if known else 0,
    }


def _stamp(t_ns: int) -> dict[str, int]:
    sec, nsec = divmod(t_ns, 1_000_000_000)
    return {"sec": sec, "nsec": nsec}

"""Build the messages of a recording from poses and anchors, in schemas that viewers draw."""

import math
from collections.abc import Iterable, Iterator

import numpy as np

from dropanchor_schemas.keys import chunk_from_id
from dropanchor_service.answers.answers import to_json
from dropanchor_service.answers.columns import REASONS
from dropanchor_service.answers.frames import FRAMES, STATES, in_site_frame
from dropanchor_service.answers.geodesy import altitude, lat_lon
from dropanchor_service.answers.pose_fields import height_source_values
from dropanchor_service.estimation.columns import Array, Frame
from dropanchor_service.history.records import ESTIMATED
from dropanchor_service.recording import schemas
from dropanchor_service.store.floors import is_height_known
from dropanchor_service.store.site_values import SiteDocument

FRAME = "site"
SITE_TOPIC = "/site"
ESTIMATE = "estimate"  # the last part of a topic
IDENTITY_ROTATION = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
COVARIANCE_APPROXIMATED = 1  # foxglove.LocationFix.position_covariance_type
UNKNOWN_VARIANCE = 1e6  # m², of an altitude that is not known

Message = tuple[str, str, bytes]
"""Topic, schema name, JSON."""


def topic_of(tag: str, leaf: str) -> str:
    """Return the topic of a tag. leaf: its last part."""
    return f"/tag/{chunk_from_id(tag)}/{leaf}"


def site_messages(document: SiteDocument, t_ns: int) -> Iterator[Message]:
    """Yield the site document, which a replay needs, and the anchor positions, which viewers draw."""
    yield SITE_TOPIC, schemas.SITE, document.model_dump_json().encode()
    for anchor in document.site.anchors:
        transform = {
            "timestamp": _stamp(t_ns),
            "parent_frame_id": FRAME,
            "child_frame_id": f"anchor/{anchor.id}",
            "translation": {"x": anchor.x, "y": anchor.y, "z": anchor.z},
            "rotation": IDENTITY_ROTATION,
        }
        yield "/tf", schemas.TRANSFORM, to_json(transform)


def pose_messages(pose: Array, tag: str, anchor: str | None, document: SiteDocument) -> Iterator[Message]:
    """Yield the messages of a pose. pose: POSE (0-d). An unknown position gives an estimate only.

    A place in a frame of the tag's own has a topic and a frame id of its own, so that nobody draws it in the site.
    """
    stamp = _stamp(int(pose["t_ns"]))
    yield topic_of(tag, ESTIMATE), schemas.ESTIMATE, to_json(_estimate(pose, anchor))
    x, y, heading = (float(pose[name]) for name in ("x", "y", "heading"))
    if not math.isfinite(x + y):
        return
    rotation = {"x": 0.0, "y": 0.0, "z": math.sin(heading / 2), "w": math.cos(heading / 2)}
    settings, z = document.tags.get(tag), float(pose["z"])
    told = 0.0 if settings is None else settings.height_m
    placement = {
        "position": {"x": x, "y": y, "z": z if math.isfinite(z) else told},
        "orientation": rotation if math.isfinite(heading) else IDENTITY_ROTATION,
    }
    relative = pose["frame"] == Frame.RELATIVE
    leaf, frame_id = ("relative_pose", f"{FRAME}/{tag}") if relative else ("pose", FRAME)
    yield topic_of(tag, leaf), schemas.POSE, to_json({"timestamp": stamp, "frame_id": frame_id, "pose": placement})
    if document.site.georeference is not None and not relative:
        yield topic_of(tag, "location"), schemas.LOCATION, to_json({"timestamp": stamp} | _location(pose, document))


def _estimate(pose: Array, anchor: str | None) -> dict[str, object]:
    """Return the fields of an estimate, without those that are unknown."""
    published = in_site_frame(pose[None])[0]
    fields: dict[str, object] = {
        "t_ns": int(pose["t_ns"]),
        "state": STATES[published["state"]],
        "reason": REASONS[pose["reason"]],
        "frame": FRAMES[pose["frame"]],
        **_numbers(published, ESTIMATED),
    }
    if math.isfinite(pose["z"]):
        fields["z_source"] = height_source_values(pose[None])[0]
    if pose["frame"] == Frame.RELATIVE and math.isfinite(pose["x"]):
        fields["relative_pose"] = _numbers(pose, schemas.OF_RELATIVE)
    return fields if anchor is None else fields | {"anchor": anchor}


def _numbers(pose: Array, names: Iterable[str]) -> dict[str, object]:
    """Return the known ones of these numbers of a POSE (0-d), and its covariance."""
    numbers = {name: float(pose[ESTIMATED[name]]) for name in names}
    known: dict[str, object] = {name: value for name, value in numbers.items() if math.isfinite(value)}
    return known | ({"covariance": pose["cov"].reshape(-1).tolist()} if np.isfinite(pose["cov"]).all() else {})


def _location(pose: Array, document: SiteDocument) -> dict[str, object]:
    """Return a foxglove.LocationFix. Its covariance is in east, north and up.

    JSON has no NaN, so an altitude that is not known is 0 with a variance that says so.
    """
    origin = document.site.georeference
    assert origin is not None
    lat, lon = lat_lon(origin, pose["x"], pose["y"])
    alt_m = altitude(origin, pose["z"])
    has_altitude = alt_m is not None and bool(is_height_known(pose[None])[0])
    angle = origin.rotation_rad
    enu_from_site = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    covariance = np.diag([0.0, 0.0, pose["z_std"] ** 2 if has_altitude else UNKNOWN_VARIANCE])
    covariance[:2, :2] = enu_from_site @ pose["cov"][:2, :2] @ enu_from_site.T
    known = bool(np.isfinite(covariance).all())
    return {
        "frame_id": FRAME,
        "latitude": float(lat),
        "longitude": float(lon),
        "altitude": float(alt_m) if alt_m is not None and has_altitude else 0.0,
        "position_covariance": covariance.reshape(-1).tolist() if known else [0.0] * 9,
        "position_covariance_type": COVARIANCE_APPROXIMATED if known else 0,
    }


def _stamp(t_ns: int) -> dict[str, int]:
    sec, nsec = divmod(t_ns, 1_000_000_000)
    return {"sec": sec, "nsec": nsec}

"""Draw anchors, tags and their 95 % ellipses as Foxglove messages, from the JSON of the REST interface."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from foxglove.messages import (
    ArrowPrimitive,
    Color,
    CubePrimitive,
    Duration,
    FrameTransform,
    FrameTransforms,
    LinePrimitive,
    LinePrimitiveLineType,
    LocationFix,
    LocationFixes,
    Point3,
    Pose,
    PoseInFrame,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    SpherePrimitive,
    TextPrimitive,
    Timestamp,
    Vector3,
)

from dropanchor_service.bridges.frames import SITE, anchor_frame_id, frame_id, in_its_frame, tag_frame_id

Json = Mapping[str, Any]

LIFETIME_S = 5  # what the service no longer confirms disappears after that
_SIZE_M = 0.3
_CORNERS = 48
_WHITE = Color(r=1.0, g=1.0, b=1.0, a=1.0)
_NO_ROTATION = Quaternion(w=1.0)
_COLOURS: Final = {
    "tracking": (0.20, 0.75, 0.40),
    "relative": (0.25, 0.75, 0.75),
    "coasting": (0.30, 0.65, 0.95),
    "degraded": (0.95, 0.70, 0.20),
    "ambiguous": (0.75, 0.50, 0.95),
    "initialising": (0.70, 0.70, 0.70),
    "lost": (0.90, 0.30, 0.30),
}


def is_placed(pose: Json) -> bool:
    """Return whether the position is known."""
    return pose["x"] is not None and pose["y"] is not None


def transforms(
    poses: Iterable[Json], anchors: Iterable[Json], heights: Mapping[str, float], t_ns: int
) -> FrameTransforms:
    """Return a frame per anchor and per placed tag. heights: of tags, m. t_ns: time of the anchors' frames."""
    of_anchors = [
        FrameTransform(
            timestamp=_stamp(t_ns),
            parent_frame_id=SITE,
            child_frame_id=anchor_frame_id(anchor["id"]),
            translation=Vector3(x=anchor["x"], y=anchor["y"], z=anchor["z"]),
            rotation=_NO_ROTATION,
        )
        for anchor in anchors
    ]
    of_tags = [
        FrameTransform(
            timestamp=_stamp(pose["t_ns"]),
            parent_frame_id=frame_id(pose),
            child_frame_id=tag_frame_id(pose["tag"]),
            translation=Vector3(x=pose["x"], y=pose["y"], z=heights.get(pose["tag"], 0.0)),
            rotation=_rotation(pose),
        )
        for pose in map(in_its_frame, poses)
        if is_placed(pose)
    ]
    return FrameTransforms(transforms=of_anchors + of_tags)


def scene(poses: Iterable[Json], anchors: Iterable[Json], heights: Mapping[str, float], t_ns: int) -> SceneUpdate:
    """Return an entity per anchor, per placed tag and per tag with hypotheses. t_ns: time of the answer."""
    of_anchors = [_anchor_entity(anchor, t_ns) for anchor in anchors]
    of_tags = [
        _tag_entity(pose, heights.get(pose["tag"], 0.0), t_ns)
        for pose in map(in_its_frame, poses)
        if is_placed(pose) or pose["hypotheses"]
    ]
    return SceneUpdate(entities=of_anchors + of_tags)


def pose_in_frame(pose: Json, height_m: float) -> PoseInFrame:
    """Return the message of a placed pose. An unknown heading becomes 0."""
    return PoseInFrame(timestamp=_stamp(pose["t_ns"]), frame_id=frame_id(pose), pose=_placement(pose, height_m))


def location_fixes(poses: Iterable[Json]) -> LocationFixes:
    """Return the location of each pose on the Earth that is known, for maps."""
    fixes = [
        LocationFix(
            timestamp=_stamp(pose["t_ns"]),
            frame_id=tag_frame_id(pose["tag"]),
            latitude=pose["lat"],
            longitude=pose["lon"],
            altitude=math.nan if pose.get("alt_m") is None else pose["alt_m"],
            color=_colour(pose["state"], 1.0),
        )
        for pose in poses
        if pose.get("lat") is not None and pose.get("lon") is not None
    ]
    return LocationFixes(fixes=fixes)


def _anchor_entity(anchor: Json, t_ns: int) -> SceneEntity:
    place = {axis: float(anchor[axis]) for axis in "xyz"}
    size = Vector3(x=_SIZE_M, y=_SIZE_M, z=_SIZE_M)
    cube = CubePrimitive(pose=_at(**place), size=size, color=_WHITE)
    return _entity(f"anchor/{anchor['id']}", SITE, t_ns, cubes=[cube], texts=[_label(anchor["id"], _WHITE, **place)])


def _tag_entity(pose: Json, height_m: float, t_ns: int) -> SceneEntity:
    """Return the entity of a tag: its body, its heading, its ellipse, and its hypotheses, fainter with less weight."""
    colour = _colour(pose["state"], 1.0)
    ellipses = [
        _outline(one["ellipse_95"], one["x"], one["y"], height_m, _colour(pose["state"], max(0.2, one["weight"])))
        for one in pose["hypotheses"]
        if one["ellipse_95"] is not None
    ]
    if not is_placed(pose):
        return _entity(tag_frame_id(pose["tag"]), frame_id(pose), t_ns, lines=ellipses)
    if pose["ellipse_95"] is not None:
        ellipses.append(_outline(pose["ellipse_95"], pose["x"], pose["y"], height_m, colour))
    body = SpherePrimitive(pose=_placement(pose, height_m), size=Vector3(x=_SIZE_M, y=_SIZE_M, z=_SIZE_M), color=colour)
    arrow = ArrowPrimitive(
        pose=_placement(pose, height_m),
        shaft_length=2 * _SIZE_M,
        shaft_diameter=_SIZE_M / 4,
        head_length=_SIZE_M,
        head_diameter=_SIZE_M / 2,
        color=colour,
    )
    return _entity(
        tag_frame_id(pose["tag"]),
        frame_id(pose),
        t_ns,
        spheres=[body],
        arrows=[] if pose["heading_rad"] is None else [arrow],
        lines=ellipses,
        texts=[_label(f"{pose['tag']}: {pose['state']}", colour, pose["x"], pose["y"], height_m)],
    )


def _entity(name: str, frame: str, t_ns: int, **primitives: Any) -> SceneEntity:
    return SceneEntity(timestamp=_stamp(t_ns), frame_id=frame, id=name, lifetime=Duration(LIFETIME_S), **primitives)


def _outline(ellipse: Json, x: float, y: float, z: float, colour: Color) -> LinePrimitive:
    points = ellipse_points(ellipse["semi_major_m"], ellipse["semi_minor_m"], ellipse["angle_rad"])
    return LinePrimitive(
        type=LinePrimitiveLineType.LineLoop,
        pose=_at(x, y, z),
        thickness=2.0,
        scale_invariant=True,  # pixels
        points=[Point3(x=east, y=north) for east, north in points],
        color=colour,
    )


def ellipse_points(major_m: float, minor_m: float, angle_rad: float) -> Sequence[tuple[float, float]]:
    """Return points on an ellipse about the origin, m. The major axis points to `angle_rad`."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    around = (2 * math.pi * corner / _CORNERS for corner in range(_CORNERS))
    on_axes = ((major_m * math.cos(turn), minor_m * math.sin(turn)) for turn in around)
    return [(along * cos - across * sin, along * sin + across * cos) for along, across in on_axes]


def _label(text: str, colour: Color, x: float, y: float, z: float) -> TextPrimitive:
    above = _at(x, y, z + 2 * _SIZE_M)
    return TextPrimitive(pose=above, billboard=True, font_size=14.0, scale_invariant=True, color=colour, text=text)


def _placement(pose: Json, height_m: float) -> Pose:
    return Pose(position=Vector3(x=pose["x"], y=pose["y"], z=height_m), orientation=_rotation(pose))


def _at(x: float, y: float, z: float) -> Pose:
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=_NO_ROTATION)


def _rotation(pose: Json) -> Quaternion:
    half_rad = (pose["heading_rad"] or 0.0) / 2
    return Quaternion(z=math.sin(half_rad), w=math.cos(half_rad))


def _colour(state: str, opacity: float) -> Color:
    red, green, blue = _COLOURS[state]
    return Color(r=red, g=green, b=blue, a=opacity)


def _stamp(t_ns: int) -> Timestamp:
    sec, nsec = divmod(t_ns, 1_000_000_000)
    return Timestamp(sec, nsec)

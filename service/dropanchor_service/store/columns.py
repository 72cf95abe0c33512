"""Poses as columns of the contract: what an engine wrote, with everything an answer derives from it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_schemas.pose import StateReason as ReasonName
from dropanchor_schemas.pose import TrackingState
from dropanchor_service.estimation.batch import Array, State, StateReason
from dropanchor_service.store.geodesy import lat_lon
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable

STALE_AFTER_S = 1.0
LOST_AFTER_S = 10.0
CHI2_95_OF_2 = 5.991464547107979  # -2 ln 0.05: 95 % quantile of the chi-squared distribution, 2 degrees of freedom

STATES = [TrackingState[state.name].value for state in State]
REASONS = [ReasonName[reason.name].value for reason in StateReason]

_MOVE_HINT = "Walk a few metres, not straight towards the anchor or away from it."
_HINTS = {
    StateReason.NO_RANGE: "Too few ranges have come in: is the anchor on, and the tag within its reach?",
    StateReason.NO_HEADING: "No heading yet: the tag has to send IMU samples or a platform heading.",
    StateReason.START_UNKNOWN: "Say where the tag starts (`start` in its settings), or let the engine fleet find it.",
    StateReason.SEVERAL_MODES: _MOVE_HINT,
    StateReason.RESOLVED: "",
    StateReason.RANGES_MISSING: "No range comes in any more: is the anchor on, and the tag within its reach?",
    StateReason.IMU_MISSING: "No IMU samples came in for a while: check the tag, then walk a few metres.",
    StateReason.RANGES_REJECTED: "The ranges contradict the track: is the line of sight free, and is the anchor where "
    "the site says it is?",
    StateReason.HEADING_DISTURBED: "Iron or a magnet disturbs the compass: move away from it.",
    StateReason.UNCERTAIN: _MOVE_HINT,
    StateReason.FAULT: "The estimate had to start afresh; if this repeats, check what the tag sends.",
    StateReason.HEADING_UNSURE: "How far it is and what it has walked is known, but not where north is: say where the "
    "tag starts, or add a second anchor.",
}
HINTS = [_HINTS[reason] for reason in StateReason]


@dataclass(frozen=True)
class PoseColumns:
    """One entry per pose. poses: POSE; the others derived; an unknown float is NaN. lat, lon: None without a
    georeference."""

    poses: Array
    tags: list[str]
    online: list[bool]
    anchors: list[str | None]
    age_s: Array
    states: list[str]
    reasons: list[str]
    hints: list[str]
    semi_major_m: Array
    semi_minor_m: Array
    angle_rad: Array
    lat: Array | None
    lon: Array | None


def columns_of(
    poses: Array,
    site: SiteStore,
    tags: TagTable,
    now_ns: int,
    then: bool = False,
    names: Sequence[str] | None = None,
) -> PoseColumns:
    """poses: POSE, of any rows that `tags` knows, or of the tags of these names; then: they hold for their own time,
    and do not get old."""
    age_s = (now_ns - poses["t_ns"]) * 1e-9
    aged = poses if then else with_age(poses, age_s)
    of_tags = [tags.at(row).name for row in aged["row"].tolist()] if names is None else list(names)
    anchor_ids = [anchor.id for anchor in site.anchors_by_index()]
    reasons = aged["reason"].tolist()
    ellipse = ellipse_95(aged["cov"][:, :2, :2])
    origin = site.site.georeference
    lat, lon = (None, None) if origin is None else lat_lon(origin, aged["x"], aged["y"])
    return PoseColumns(
        poses=aged,
        tags=of_tags,
        online=[tags.is_online(tag) for tag in of_tags],
        anchors=[anchor_ids[index] if 0 <= index < len(anchor_ids) else None for index in aged["anchor"].tolist()],
        age_s=age_s,
        states=[STATES[state] for state in aged["state"].tolist()],
        reasons=[REASONS[reason] for reason in reasons],
        hints=[HINTS[reason] for reason in reasons],
        semi_major_m=ellipse[0],
        semi_minor_m=ellipse[1],
        angle_rad=ellipse[2],
        lat=lat,
        lon=lon,
    )


def with_age(poses: Array, age_s: Array) -> Array:
    """The poses (POSE) as they may be shown at this age: no engine runs while a tag is silent, yet an old pose must
    not look like a good one."""
    coasting = (age_s > STALE_AFTER_S) & (poses["state"] == State.TRACKING)
    lost = age_s > LOST_AFTER_S
    late = coasting | lost
    if not late.any():
        return poses
    aged = poses.copy()
    aged["state"][coasting] = State.COASTING
    aged["state"][lost] = State.LOST
    aged["reason"][late] = StateReason.RANGES_MISSING
    return aged


def ellipse_95(cov: Array) -> tuple[Array, Array, Array]:
    """Semi-major and semi-minor axis [m] and direction [rad] of the 95 % ellipses of cov (n × 2 × 2), NaN where cov
    is not finite: x = sqrt(χ² λ) with the eigenvalues λ of a symmetric 2 × 2 matrix in closed form."""
    a, b, c = cov[:, 0, 0], cov[:, 0, 1], cov[:, 1, 1]
    with np.errstate(invalid="ignore"):
        mean, half = (a + c) / 2, np.hypot((a - c) / 2, b)
        major = np.sqrt(CHI2_95_OF_2 * np.maximum(mean + half, 0.0))
        minor = np.sqrt(CHI2_95_OF_2 * np.maximum(mean - half, 0.0))
        angle = np.arctan2(2 * b, a - c) / 2
    unknown = ~np.isfinite(major + minor + angle)
    for column in (major, minor, angle):
        column[unknown] = np.nan
    return major, minor, angle

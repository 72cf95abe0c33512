"""Poses as columns of the contract: what an engine wrote, with everything an answer derives from it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_schemas.pose import StateReason as ReasonName
from dropanchor_schemas.pose import TrackingState
from dropanchor_service.answers.geodesy import lat_lon
from dropanchor_service.answers.kernels.ageing import STALE_AFTER_S, ellipses, grow_old
from dropanchor_service.estimation.columns import Array, State, StateReason
from dropanchor_service.store.records import copied
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable
from dropanchor_service.store.unknown_anchors import hint_about

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
_LACK_OF_RANGES = [StateReason.NO_RANGE, StateReason.RANGES_MISSING]


@dataclass(frozen=True)
class PoseColumns:
    """One entry per pose. poses: POSE; the others derived; an unknown float is NaN. hint: by its index in `hint_texts`.
    anchor_ids: by the index that the poses have of them. lat, lon: None without a georeference."""

    poses: Array
    tags: list[str]
    online: Array
    hint_texts: Sequence[str]
    hint: Array
    anchor_ids: list[str]
    age_s: Array
    semi_major_m: Array
    semi_minor_m: Array
    angle_rad: Array
    lat: Array | None
    lon: Array | None

    @property
    def states(self) -> list[str]:
        return [STATES[state] for state in self.poses["state"].tolist()]

    @property
    def reasons(self) -> list[str]:
        return [REASONS[reason] for reason in self.poses["reason"].tolist()]

    @property
    def hints(self) -> list[str]:
        return [self.hint_texts[index] for index in self.hint.tolist()]

    @property
    def anchors(self) -> list[str | None]:
        ids = self.anchor_ids
        return [ids[index] if 0 <= index < len(ids) else None for index in self.poses["anchor"].tolist()]


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
    age_s = (now_ns - poses["t_ns"]) * 1e-9 if then else tags.age_s(poses, now_ns)
    aged = poses if then else with_age(poses, age_s)
    of_tags = tags.names(aged["row"].tolist()) if names is None else list(names)
    ellipse = ellipse_95(aged["cov"])
    hint_texts, hint = (HINTS, aged["reason"]) if then else _hints(aged, site, tags, now_ns)
    origin = site.site.georeference
    lat, lon = (None, None) if origin is None else lat_lon(origin, aged["x"], aged["y"])
    return PoseColumns(
        poses=aged,
        tags=of_tags,
        online=tags.are_online(aged["row"]) if names is None else np.array([tags.is_online(name) for name in names]),
        hint_texts=hint_texts,
        hint=hint,
        anchor_ids=[anchor.id for anchor in site.anchors_by_index()],
        age_s=age_s,
        semi_major_m=ellipse[0],
        semi_minor_m=ellipse[1],
        angle_rad=ellipse[2],
        lat=lat,
        lon=lon,
    )


def _hints(poses: Array, site: SiteStore, tags: TagTable, now_ns: int) -> tuple[Sequence[str], Array]:
    """Texts, and the index of the one that fits each POSE: a tag that lacks ranges and hears an unknown anchor is told
    so."""
    unknown = {row: name for row, number, name in tags.unknown_anchors.fresh(now_ns) if site.lacks(number)}
    lacking = np.isin(poses["reason"], _LACK_OF_RANGES) if unknown else np.zeros(len(poses), bool)
    if not lacking.any():
        return HINTS, poses["reason"]
    hint = poses["reason"].astype(np.int64)
    places: dict[str, int] = {}
    for place in np.flatnonzero(lacking).tolist():
        name = unknown.get(int(poses["row"][place]))
        if name is not None:
            hint[place] = places.setdefault(name, len(HINTS) + len(places))
    return [*HINTS, *map(hint_about, places)], hint


def with_age(poses: Array, age_s: Array) -> Array:
    """The poses (POSE) as they may be shown at this age: no engine runs while a tag is silent, yet an old pose must
    not look like a good one."""
    if age_s.max(initial=0.0) <= STALE_AFTER_S:
        return poses
    aged = copied(poses)
    grow_old(aged, age_s)
    return aged


def ellipse_95(cov: Array) -> Array:
    """Semi-major and semi-minor axis [m] and direction [rad] of the 95 % ellipses of cov, n × 2 × 2 or more, NaN where
    cov is not finite."""
    axes = np.empty((3, len(cov)))
    ellipses(np.ascontiguousarray(cov), axes)
    return axes

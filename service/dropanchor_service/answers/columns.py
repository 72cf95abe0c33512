"""Turn poses into columns of the contract: what an engine wrote, and what an answer derives from it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_schemas.pose import StateReason as ReasonName
from dropanchor_schemas.site import Site
from dropanchor_service.answers.frames import OwnFrames, in_site_frame, own_frames
from dropanchor_service.answers.geodesy import altitude, lat_lon
from dropanchor_service.answers.hints import hints_of, past_hints
from dropanchor_service.answers.kernels.ageing import STALE_AFTER_S, age_poses, ellipses
from dropanchor_service.estimation.columns import Array, StateReason
from dropanchor_service.store.records import copied
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable

REASONS = [ReasonName[reason.name].value for reason in StateReason]


@dataclass(frozen=True)
class PoseColumns:
    """Columns with one entry per pose. An unknown float is NaN.

    poses: POSE in the site frame, with states of `frames.STATES`; the other columns are derived from it. own: those in
    frames of the tags' own, None if there are none. hint: index into `hint_texts`. anchor_ids: by the index that the
    poses hold. floor: index into `floor_names`, -1: not known. lat, lon: degrees, None without a georeference. alt_m:
    None without its altitude. epoch: of the process, see `SiteStore`.
    """

    poses: Array
    own: OwnFrames | None
    tags: list[str]
    online: Array
    hint_texts: Sequence[str]
    hint: Array
    anchor_ids: list[str]
    age_s: Array
    semi_major_m: Array
    semi_minor_m: Array
    angle_rad: Array
    floor_names: Sequence[str]
    floor: Array
    floor_probability: Array
    lat: Array | None
    lon: Array | None
    alt_m: Array | None
    epoch: int


def columns_of(
    poses: Array,
    site: SiteStore,
    tags: TagTable,
    now_ns: int,
    historical: bool = False,
    names: Sequence[str] | None = None,
) -> PoseColumns:
    """Return the columns of these poses.

    poses: POSE, of rows in `tags`. historical: the poses are for their own time, so they are not aged. names: the
    tags of the poses, if they may have no row.
    """
    age_s = (now_ns - poses["t_ns"]) * 1e-9 if historical else tags.rows.age_s(poses, now_ns)
    aged = poses if historical else aged_poses(poses, tags.rows.overdue_s(poses, now_ns))
    if names is None:
        of_tags, online = tags.rows.names(aged["row"].tolist()), tags.presence.are_online(aged["row"])
    else:
        of_tags, online = list(names), np.array([tags.presence.is_online(name) for name in names])
    published = in_site_frame(aged)
    ellipse = ellipse_95(published["cov"])
    hint_texts, hint = past_hints(aged) if historical else hints_of(aged, site, tags, now_ns)
    floor, floor_probability = site.floors.likeliest(published)
    lat, lon, alt_m = _place_on_earth(published, site.site)
    return PoseColumns(
        poses=published,
        own=own_frames(aged),
        tags=of_tags,
        online=online,
        hint_texts=hint_texts,
        hint=hint,
        anchor_ids=[anchor.id for anchor in site.anchors_by_index()],
        age_s=age_s,
        semi_major_m=ellipse[0],
        semi_minor_m=ellipse[1],
        angle_rad=ellipse[2],
        floor_names=site.floors.names,
        floor=floor,
        floor_probability=floor_probability,
        lat=lat,
        lon=lon,
        alt_m=alt_m,
        epoch=site.epoch,
    )


def _place_on_earth(poses: Array, site: Site) -> tuple[Array | None, Array | None, Array | None]:
    """Return latitude, longitude and altitude, NaN where x, y and z are; None where the site does not know its own."""
    origin = site.georeference
    if origin is None:
        return None, None, None
    return *lat_lon(origin, poses["x"], poses["y"]), altitude(origin, poses["z"])


def aged_poses(poses: Array, age_s: Array) -> Array:
    """Return these POSE with the state and reason that they have at this age.

    age_s: their age, without the time that they waited for IMU samples in batches. No engine runs while a tag is
    silent, and an old pose must not look like a good one.
    """
    if age_s.max(initial=0.0) <= STALE_AFTER_S:
        return poses
    aged = copied(poses)
    age_poses(aged, age_s)
    return aged


def ellipse_95(cov: Array) -> Array:
    """Return semi-major axis [m], semi-minor axis [m] and direction [rad] of 95 % ellipses, NaN where not finite.

    cov: n × 2 × 2 or more, of which the first two rows and columns are those of (x, y).
    """
    axes = np.empty((3, len(cov)))
    ellipses(np.ascontiguousarray(cov), axes)
    return axes

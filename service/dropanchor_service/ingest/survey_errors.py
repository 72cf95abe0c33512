"""What the survey of the anchors leaves open about places that several of them tell.

An anchor that stands s elsewhere than the site says shifts a place that its ranges tell. With u the direction from each
anchor to the tag, the errors of all of them, each s along its u, shift it with the covariance s² (Σ u uᵀ)⁻¹: by many
times s far outside of the anchors. They are the same all the time, so no filter of the ranges averages them out.
"""

import numpy as np

from dropanchor_schemas.pose import SigmaParts
from dropanchor_service.estimation.columns import Array, Frame

SURVEY_STD_M = 0.1  # of an anchor along any direction: a measuring tape, or a laser to a corner
HELD = 0.04  # added to Σ u uᵀ: where no range tells a direction, the IMU holds the track, so at most 0.5 m are added
RANGES = list(SigmaParts.model_fields).index("ranges_m")


def widen(poses: Array, anchors: Array, heard: Array, places: Array) -> None:
    """Add what the survey leaves open to the covariance of tags that hear several anchors, and to what tells of it.

    poses: POSE (n,), changed in place. anchors, heard: (n, k), indices of `places`, which are ANCHOR, and whether the
    tag hears them.
    """
    known = (poses["frame"] == Frame.SITE) & np.isfinite(poses["x"])
    several = np.flatnonzero(known & (heard.sum(axis=1) > 1))
    if not len(several):
        return
    at, heard = places[anchors[several]], heard[several]
    dx, dy = (np.where(heard, poses[axis][several][:, None] - at[axis], 0.0) for axis in "xy")
    r = np.maximum(np.hypot(dx, dy), 1e-3)
    ux, uy = dx / r, dy / r
    xx, xy, yy = (ux * ux).sum(axis=1) + HELD, (ux * uy).sum(axis=1), (uy * uy).sum(axis=1) + HELD
    scale = SURVEY_STD_M**2 / (xx * yy - xy * xy)
    for i, j, part in ((0, 0, yy), (0, 1, -xy), (1, 0, -xy), (1, 1, xx)):
        poses["cov"][several, i, j] += scale * part
    added = scale * (xx + yy)
    poses["sigma_pos"][several] = np.sqrt(poses["sigma_pos"][several] ** 2 + added)
    told = several[poses["parts"][several].sum(axis=1) > 0.0]
    poses["parts"][told, RANGES] = np.sqrt(poses["parts"][told, RANGES] ** 2 + added[np.isin(several, told)])

"""Turn poses into the Gaussians that zones judge, and leave out poses that say nothing about the place of a tag."""

from dataclasses import dataclass

import numpy as np

from dropanchor_service.estimation.columns import Array, Frame, State
from dropanchor_service.store.latest_poses import LatestPoses
from dropanchor_service.store.records import take
from dropanchor_service.zones.judge import MODE

MAX_AGE_S = 1.0
_PLACED = (State.AMBIGUOUS, State.TRACKING, State.COASTING, State.DEGRADED)


@dataclass(frozen=True)
class PlacedPoses:
    """Poses with a known place. poses: POSE. modes: MODE, first[i] is the index of the first one of pose i."""

    poses: Array
    modes: Array
    first: Array

    def single(self) -> tuple[Array, Array]:
        """Return the POSE of the tags that have one place, and its MODE."""
        single = self.poses["state"] != State.AMBIGUOUS
        return self.poses[single], self.modes[self.first[:-1][single]]


def placed(poses: Array, age_s: Array, latest: LatestPoses) -> PlacedPoses:
    """Return the poses that are current, finite and in the site frame, with their modes.

    poses: POSE. age_s: their age. latest: holds the hypotheses of ambiguous tags.
    """
    kept = take(poses, _are_placed(poses, age_s))
    ambiguous = kept["state"] == State.AMBIGUOUS
    hypotheses, counts = latest.hypotheses_of(kept["row"][ambiguous])
    lengths = np.ones(len(kept), np.int64)
    lengths[ambiguous] = counts
    first = np.concatenate([[0], np.cumsum(lengths)])
    modes = np.zeros(first[-1], MODE)
    of_hypotheses = np.repeat(ambiguous, lengths)
    single, several = np.flatnonzero(~of_hypotheses), np.flatnonzero(of_hypotheses)
    for name in ("x", "y"):
        modes[name][single], modes[name][several] = kept[name][~ambiguous], hypotheses[name]
    modes["cov"][single], modes["cov"][several] = kept["cov"][~ambiguous, :2, :2], hypotheses["cov"]
    p_mode = kept["p_mode"][~ambiguous]
    modes["weight"][single], modes["weight"][several] = np.where(np.isnan(p_mode), 1.0, p_mode), hypotheses["weight"]
    return PlacedPoses(kept, modes, first)


def _are_placed(poses: Array, age_s: Array) -> Array:
    variances = poses["cov"][:, :2, :2].reshape(-1, 4)
    usable: Array = (
        (poses["frame"] == Frame.SITE)
        & np.isin(poses["state"], _PLACED)
        & (age_s <= MAX_AGE_S)
        & np.isfinite(poses["x"] + poses["y"])
        & np.isfinite(variances).all(axis=1)
    )
    return usable

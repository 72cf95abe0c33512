"""Scores of one tag's track against its truth, and of all tags of a row."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import Array, Frame, State
from dropanchor_service.offline.accuracy import Truth, nees, share_of_time, truth_at
from dropanchor_service.offline.replay import Track

LOST_M = 2.0


@dataclass(frozen=True)
class TagScore:
    """The score of one tag. Errors are in m over the poses with a position; inf if there is none.

    second_half: RMSE over the second half of the time; rotated: the same after the best rotation about the anchor.
    end: error of the last pose, inf without a position. tracking_after_s: time from the first pose to the first in
    state tracking, inf: never. tracking_share: share of the time. tracked: number of poses in state tracking with a
    truth. covered: number of these whose 95 % ellipse contains it. worst_sigma: their largest normalised error (NaN:
    none).
    """

    name: str
    rmse: float
    second_half: float
    rotated: float
    end: float
    tracking_after_s: float
    tracking_share: float
    tracked: int
    covered: int
    worst_sigma: float


@dataclass(frozen=True)
class RowScore:
    """The score of a row over all its tags: medians and 90 % quantiles of RMSE, shares, and consistency.

    lost: share of the tags that are more than 2 m off at the end. tracking_after_s: median, inf if half of the tags
    never track. never: share of the tags that never track. coverage: over all tracking poses. us: processor time of
    the engine, µs per tag and second.
    """

    tags: int
    rmse: tuple[float, float]
    second_half: tuple[float, float]
    rotated: tuple[float, float]
    lost: float
    tracking_after_s: float
    never: float
    tracking_share: float
    coverage: float
    worst_sigma: float
    us: float


def score(name: str, track: Track, truth: Truth, anchor: tuple[float, float], no_north: bool) -> TagScore:
    """Compare a track with the truth.

    The truth of poses in a frame of the tag's own is first rotated about the anchor to fit those in state tracking, or
    all of them if there are none. no_north: so is that of poses in the site frame.
    """
    true = np.column_stack(truth_at(truth, track.t))
    found = np.column_stack([track.poses["x"], track.poses["y"]])
    judged = np.isfinite(true).all(axis=1)
    used = judged & np.isfinite(found).all(axis=1)
    if not used.any():
        return TagScore(name, math.inf, math.inf, math.inf, math.inf, math.inf, 0.0, 0, 0, math.nan)
    tracking = track.poses["state"] == State.TRACKING
    own = used & (track.poses["frame"] == Frame.RELATIVE)
    for rotated in (own, used & ~own) if no_north else (own,):
        declared = rotated & tracking
        true[rotated] = rotated_onto(true, found, declared if declared.any() else rotated, anchor)[rotated]
    error = found - true
    late = used & (track.t >= (track.t[0] + track.t[-1]) / 2)
    squared = nees(error, track.poses["cov"][:, :2, :2])[used & tracking]
    squared = np.where(np.isfinite(squared), squared, np.inf)  # a singular ellipse contains nothing
    return TagScore(
        name=name,
        rmse=_rms(error[used]),
        second_half=_rms(error[late]),
        rotated=_rms((found - rotated_onto(true, found, late, anchor))[late]),
        end=_last(np.hypot(*error[judged].T)),
        tracking_after_s=float(track.t[tracking.argmax()] - track.t[0]) if tracking.any() else math.inf,
        tracking_share=share_of_time(track.t, track.poses["state"]).get("tracking", 0.0),
        tracked=len(squared),
        covered=int(np.count_nonzero(squared <= CHI2_95_OF_2)),
        worst_sigma=float(np.sqrt(squared.max())) if len(squared) else math.nan,
    )


def rotated_onto(true: Array, found: Array, used: Array, anchor: tuple[float, float]) -> Array:
    """Return `true` (n, 2), rotated about the anchor so that its used rows fit `found` best."""
    pivot = np.asarray(anchor)
    a, b = (true - pivot)[used], (found - pivot)[used]
    angle = math.atan2(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum()))
    cos, sin = math.cos(angle), math.sin(angle)
    turned: Array = (true - pivot) @ np.array([[cos, sin], [-sin, cos]]) + pivot
    return turned


def summary(scores: Sequence[TagScore], us: float) -> RowScore:
    """Return the figures of a row. Raises ValueError without any tag."""
    if not scores:
        raise ValueError("a row needs at least one tag")
    tracked = sum(one.tracked for one in scores)
    sigmas = [one.worst_sigma for one in scores if not math.isnan(one.worst_sigma)]
    after = np.array([one.tracking_after_s for one in scores])
    return RowScore(
        tags=len(scores),
        rmse=_median_and_p90([one.rmse for one in scores]),
        second_half=_median_and_p90([one.second_half for one in scores]),
        rotated=_median_and_p90([one.rotated for one in scores]),
        lost=float(np.mean([one.end > LOST_M for one in scores])),
        tracking_after_s=float(np.quantile(after, 0.5, method="higher")),
        never=float(np.mean(np.isinf(after))),
        tracking_share=float(np.mean([one.tracking_share for one in scores])),
        coverage=sum(one.covered for one in scores) / tracked if tracked else math.nan,
        worst_sigma=max(sigmas, default=math.nan),
        us=us,
    )


def _median_and_p90(values: Sequence[float]) -> tuple[float, float]:
    """Return median and 90 % quantile. With infinite values there is no interpolation, which would give NaN."""
    median, p90 = np.quantile(values, [0.5, 0.9], method="higher" if np.isinf(values).any() else "linear")
    return float(median), float(p90)


def _last(errors: Array) -> float:
    return float(errors[-1]) if np.isfinite(errors[-1]) else math.inf


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1)))) if len(error) else math.inf

"""The summary of a replay: the error in each frame, the states, and what was not used."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isnan

from dropanchor_service.answers.frames import STATES, published_states
from dropanchor_service.estimation.columns import Array, Frame
from dropanchor_service.offline.accuracy import Accuracy, Truth, accuracy, share_of_time
from dropanchor_service.offline.replay import Samples, Track


@dataclass(frozen=True)
class Score:
    """Errors of a track. site, own: of the poses in the frame of the site and in frames of the tag's own.

    None: there are no such poses with a truth. without: why there is no score at all, empty if there is one.
    """

    site: Accuracy | None = None
    own: Accuracy | None = None
    without: str = ""

    def title(self) -> str:
        """Return what the title of a picture says about the error."""
        if self.site is not None:
            return f": RMSE {self.site.rmse:.2f} m"
        return ": turned about the anchor by an unknown angle" if self.own is not None else ""


def score_of(track: Track, truth: Truth | None, anchor: tuple[float, float]) -> Score:
    """Compare the poses of each frame with the truth. anchor: x and y, m."""
    if truth is None:
        return Score()
    if not len(track.t) or truth.t[-1] < track.t[0] or truth.t[0] > track.t[-1]:
        return Score(without="the truth has no time in common with the poses")
    site, own = (_accuracy(track, track.poses["frame"] == frame, truth, anchor) for frame in Frame)
    if site is None and own is None:
        return Score(without="no pose has a position at a time for which there is truth")
    return Score(site, own)


def _accuracy(track: Track, chosen: Array, truth: Truth, anchor: tuple[float, float]) -> Accuracy | None:
    try:
        return accuracy(track.t[chosen], track.poses[chosen], truth, anchor)
    except ValueError:
        return None


def report(track: Track, score: Score, samples: Samples, start_is_given: bool) -> Iterator[str]:
    """Yield the lines of the summary."""
    if score.without:
        yield f"no accuracy: {score.without}{'' if start_is_given else _ADVICE}"
    if score.site is not None:
        yield from _in_site_frame(score.site, is_alone=score.own is None)
    if score.own is not None:
        yield (
            f"RMSE {score.own.rmse_rotated:.3f} m after the best rotation about the anchor over {score.own.compared} "
            "poses in a frame of the tag's own: its angle to the site's frame is not known"
        )
    shares = share_of_time(track.t, published_states(track.poses["state"], track.poses["frame"]), STATES)
    if track.smoothed is not None and len(track.smoothed):
        yield f"smoothed: {track.smoothed.mean():.1%} of the poses; the others are as filtered"
    yield "time: " + ", ".join(f"{name} {share:.1%}" for name, share in shares.items())
    if samples.rejected:
        yield "not used: " + rejections(samples)


_ADVICE = "; the engine did not find the start: give --start X,Y,HEADING"


def _in_site_frame(site: Accuracy, is_alone: bool) -> Iterator[str]:
    yield (
        f"RMSE {site.rmse:.3f} m (mean {site.mean:.3f}, median {site.median:.3f}, 95 % {site.p95:.3f}, "
        f"worst {site.worst:.3f}) over {site.compared} poses{'' if is_alone else ' in the frame of the site'}"
    )
    tracking = "never tracking" if isnan(site.rmse_tracking) else f"RMSE while tracking {site.rmse_tracking:.3f} m"
    yield (
        f"{tracking}; after the best rotation about the anchor {site.rmse_rotated:.3f} m; "
        f"ATE (best rigid motion) {site.ate:.3f} m"
    )
    yield f"truth inside the 95 % ellipse: {site.coverage:.1%}"


def rejections(samples: Samples) -> str:
    """Return the counts by reason, with the place of the first sample of each where it is known."""
    return ", ".join(
        f"{count:,} {reason}" + (f" (first: {samples.first[reason]})" if reason in samples.first else "")
        for reason, count in sorted(samples.rejected.items())
        if count
    )


def no_usable_range(name: str, samples: Samples) -> str:
    """Return why a recording without a usable range cannot be replayed."""
    text = f"recording {name} has no usable range to this anchor"
    return f"{text}; not used: {rejections(samples)}" if samples.rejected else text

"""Find the pose of a tag at a time: between two poses of its history, or shortly after the latest."""

import math

import numpy as np

from dropanchor_service.estimation.columns import Array, State
from dropanchor_service.estimation.interpolation import bridged, interpolated, propagated

CLOSE_NS = 1_000_000_000  # poses farther apart are not interpolated between
AHEAD_NS = 2_000_000_000  # a pose is not predicted farther ahead
FAR_NS = 10_000_000_000  # poses of the history on disk farther apart are not bridged
MAX_SPEED = 12.0  # m/s; a change of position that would be faster is a jump of the estimate

_UNLOCATED = (State.INITIALISING, State.AMBIGUOUS, State.LOST)


class NoPoseThenError(Exception):
    """There is no pose for that time; the message says why."""


class TooFarAheadError(NoPoseThenError):
    """The time is too long after the newest pose."""


class BeforeMemoryError(NoPoseThenError):
    """The time is before the poses in memory."""


def pose_at(history: Array, latest: Array, t_ns: int) -> Array:
    """Return POSE (0-d) at a time, from the poses in memory. Raises NoPoseThenError.

    history: POSE in order of time. latest: POSE (0-d), the newest of all.
    """
    newest = int(latest["t_ns"])
    if t_ns >= newest:
        return latest if t_ns == newest else _ahead(latest, t_ns)
    past = history[history["t_ns"] < newest]
    after = int(np.searchsorted(past["t_ns"], t_ns, "right"))
    if after == 0:
        since = int(past["t_ns"][0]) if len(past) else newest
        raise BeforeMemoryError(f"the stored poses begin {(since - t_ns) * 1e-9:.3f} s after that time")
    before = past[after - 1]
    if before["t_ns"] == t_ns:
        return before  # type: ignore[no-any-return]
    return _between(before, past[after] if after < len(past) else latest, t_ns)


def pose_between(before: Array | None, after: Array | None, t_ns: int) -> Array:
    """Return POSE (0-d) at a time, from the stored poses before and after it. Raises NoPoseThenError.

    Either of them may have exactly that time.
    """
    for pose in (before, after):
        if pose is not None and pose["t_ns"] == t_ns:
            return pose
    if before is None or after is None or after["t_ns"] - before["t_ns"] > FAR_NS:
        raise NoPoseThenError(
            f"there are no two stored poses around that time that are at most {FAR_NS * 1e-9:.0f} s apart"
        )
    _check_continuous(before, after)
    return bridged(before, after, t_ns)


def _ahead(latest: Array, t_ns: int) -> Array:
    ahead_ns = t_ns - int(latest["t_ns"])
    if ahead_ns > AHEAD_NS:
        raise TooFarAheadError(
            f"that time is {ahead_ns * 1e-9:.3f} s after the newest pose; "
            f"a pose is predicted at most {AHEAD_NS * 1e-9:.0f} s ahead"
        )
    if latest["state"] in _UNLOCATED or not _is_known(latest):
        raise NoPoseThenError("the position of the tag is not known well enough to predict it")
    return propagated(latest, t_ns)


def _between(before: Array, after: Array, t_ns: int) -> Array:
    gap_s = int(after["t_ns"] - before["t_ns"]) * 1e-9
    if gap_s > CLOSE_NS * 1e-9:
        raise NoPoseThenError(
            f"no range was used around that time: the poses before and after it are {gap_s:.3f} s apart"
        )
    _check_continuous(before, after)
    return interpolated(before, after, t_ns)


def _check_continuous(before: Array, after: Array) -> None:
    """Raise NoPoseThenError if one of two poses is unknown, or if the estimate jumped between them."""
    gap_s = int(after["t_ns"] - before["t_ns"]) * 1e-9
    if not (_is_known(before) and _is_known(after)):
        raise NoPoseThenError("the position of the tag was not known at that time")
    if before["frame"] != after["frame"]:
        raise NoPoseThenError("the frame of the tag's poses changed around that time")
    jump = math.hypot(after["x"] - before["x"], after["y"] - before["y"])
    if jump > MAX_SPEED * gap_s + 3 * math.hypot(before["sigma_pos"], after["sigma_pos"]):
        raise NoPoseThenError(f"the estimate jumped {jump:.1f} m around that time")


def _is_known(pose: Array) -> bool:
    numbers = [pose[name] for name in ("x", "y", "heading", "speed", "sigma_pos")]
    return bool(np.isfinite(numbers).all() and np.isfinite(pose["cov"]).all())

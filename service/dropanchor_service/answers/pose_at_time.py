"""The pose of a tag at a time: between two of its history, or a little ahead of the latest; else a reason why not."""

import math

import numpy as np

from dropanchor_service.estimation.columns import Array, State
from dropanchor_service.estimation.interpolation import bridged, interpolated, propagated

CLOSE_NS = 1_000_000_000  # poses farther apart are not interpolated between
AHEAD_NS = 2_000_000_000
FAR_NS = 10_000_000_000  # poses of the kept history farther apart are not bridged
FASTEST = 12.0  # m/s; between two poses that are farther apart than this explains, the estimate jumped

_UNPLACED = (State.INITIALISING, State.AMBIGUOUS, State.LOST)


class NoPoseThenError(Exception):
    """There is no pose for that time; the message is a sentence that says why."""


class TooFarAheadError(NoPoseThenError):
    """The time is too long after the newest pose."""


class BeforeMemoryError(NoPoseThenError):
    """The time lies before what is held in memory."""


def pose_at(history: Array, latest: Array, t_ns: int) -> Array:
    """POSE (0-d). history: POSE in order of time; latest: POSE (0-d), the newest of all. Raises NoPoseThenError."""
    newest = int(latest["t_ns"])
    if t_ns >= newest:
        return latest if t_ns == newest else _ahead(latest, t_ns)
    past = history[history["t_ns"] < newest]
    after = int(np.searchsorted(past["t_ns"], t_ns, "right"))
    if after == 0:
        since = int(past["t_ns"][0]) if len(past) else newest
        raise BeforeMemoryError(f"the poses that are kept begin {(since - t_ns) * 1e-9:.3f} s after that time")
    before = past[after - 1]
    if before["t_ns"] == t_ns:
        return before  # type: ignore[no-any-return]
    return _between(before, past[after] if after < len(past) else latest, t_ns)


def pose_between(before: Array | None, after: Array | None, t_ns: int) -> Array:
    """POSE (0-d) from the kept poses beside a time, one of which may be of that very time. Raises NoPoseThenError."""
    for pose in (before, after):
        if pose is not None and pose["t_ns"] == t_ns:
            return pose
    if before is None or after is None or after["t_ns"] - before["t_ns"] > FAR_NS:
        raise NoPoseThenError(f"no two poses at most {FAR_NS * 1e-9:.0f} s apart are kept around that time")
    _refuse_to_guess(before, after)
    return bridged(before, after, t_ns)


def _ahead(latest: Array, t_ns: int) -> Array:
    ahead_ns = t_ns - int(latest["t_ns"])
    if ahead_ns > AHEAD_NS:
        raise TooFarAheadError(
            f"that time is {ahead_ns * 1e-9:.3f} s after the newest pose; "
            f"a pose is carried {AHEAD_NS * 1e-9:.0f} s ahead at most"
        )
    if latest["state"] in _UNPLACED or not _is_known(latest):
        raise NoPoseThenError("where the tag is is not known well enough to say where it goes")
    return propagated(latest, t_ns)


def _between(before: Array, after: Array, t_ns: int) -> Array:
    gap_s = int(after["t_ns"] - before["t_ns"]) * 1e-9
    if gap_s > CLOSE_NS * 1e-9:
        raise NoPoseThenError(f"no range was used around that time: the poses beside it are {gap_s:.3f} s apart")
    _refuse_to_guess(before, after)
    return interpolated(before, after, t_ns)


def _refuse_to_guess(before: Array, after: Array) -> None:
    gap_s = int(after["t_ns"] - before["t_ns"]) * 1e-9
    if not (_is_known(before) and _is_known(after)):
        raise NoPoseThenError("where the tag was was not known then")
    jump = math.hypot(after["x"] - before["x"], after["y"] - before["y"])
    if jump > FASTEST * gap_s + 3 * math.hypot(before["sigma_pos"], after["sigma_pos"]):
        raise NoPoseThenError(f"the estimate jumped {jump:.1f} m around that time")


def _is_known(pose: Array) -> bool:
    numbers = [pose[name] for name in ("x", "y", "heading", "speed", "sigma_pos")]
    return bool(np.isfinite(numbers).all() and np.isfinite(pose["cov"]).all())

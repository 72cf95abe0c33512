"""What a simple filter does on a recording: a dot that never moves, and steps along a compass.

A walker is followed by dead reckoning: each step adds STEP_M along the tilt-compensated compass, and each range
corrects the place. It is what an engineer writes first: it knows nothing of how the device is held, of iron, of the
length of a step or of a blocked line of sight.
"""

import math

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.offline.replay import NS_PER_S, Samples, Track

STEP_M = 0.65
STEP_STD_M = (0.2, 0.2)  # of a step, along the compass and across
PEAK_MPS2 = 0.8  # above gravity, of the mean over SMOOTH_S
SMOOTH_S, SHORTEST_STEP_S = 0.1, 0.3
STEPS_PER_S = 0.5  # of somebody who walks, at least, in the mean over a recording
RANGE_STD_M, GATE = 0.3, 3.0  # a range beyond so many deviations counts as one there
START_STD_M = 0.3


def stays(samples: Samples, start: tuple[float, float]) -> Track:
    """Return a track that is at its start at each range. It has no ellipse."""
    count = len(samples.batch.ranges)
    return _track(samples, np.tile(start, (count, 1)), np.full((count, 2, 2), np.nan))


def walks(samples: Samples, start: tuple[float, float], anchor: tuple[float, float, float]) -> Track | None:
    """Return the track by steps, compass and ranges; None without a magnetometer, or if nobody walks.

    anchor: x, y and how far it is below the tag, m.
    """
    imu = samples.batch.imu
    magnetic = imu[np.isfinite(imu["mag"]).all(axis=1)]
    steps = step_times(imu)
    if len(magnetic) == 0 or len(steps) < STEPS_PER_S * (samples.end_s - samples.start_s):
        return None
    course = np.interp(steps, magnetic["t_ns"] / NS_PER_S, np.unwrap(compass(magnetic)))
    ranges = samples.batch.ranges
    times, places, covs = ranges["t_ns"] / NS_PER_S, [], []
    p, P, k = np.array(start, float), np.eye(2) * START_STD_M**2, 0
    for t, measured in zip(times.tolist(), ranges["range"].tolist(), strict=True):
        while k < len(steps) and steps[k] <= t:
            u = np.array([math.cos(course[k]), math.sin(course[k])])
            p = p + STEP_M * u
            P = P + STEP_STD_M[0] ** 2 * np.outer(u, u) + STEP_STD_M[1] ** 2 * (np.eye(2) - np.outer(u, u))
            k += 1
        p, P = corrected(p, P, measured, anchor)
        places.append(p)
        covs.append(P)
    return _track(samples, np.array(places), np.array(covs))


def corrected(p: Array, P: Array, measured: float, anchor: tuple[float, float, float]) -> tuple[Array, Array]:
    """Return place (2,) and covariance after a range, m."""
    offset = p - anchor[:2]
    distance = max(math.hypot(offset[0], offset[1], anchor[2]), 1e-3)
    H, e = offset / distance, measured - distance
    S = max(float(H @ P @ H) + RANGE_STD_M**2, (e / GATE) ** 2)
    K = P @ H / S
    return p + K * e, P - np.outer(K, H @ P)


def step_times(imu: Array) -> Array:
    """Return the times of the steps, s: peaks of the acceleration over gravity."""
    if len(imu) < 3:
        return np.empty(0)
    t = imu["t_ns"] / NS_PER_S
    size = np.linalg.norm(imu["acc"], axis=1)
    width = max(int(SMOOTH_S * (len(t) - 1) / (t[-1] - t[0])), 1)
    over = np.convolve(size - np.median(size), np.ones(width) / width, "same")
    peaks = 1 + np.flatnonzero((over[1:-1] > PEAK_MPS2) & (over[1:-1] >= over[:-2]) & (over[1:-1] > over[2:]))
    kept: list[float] = []
    for at in t[peaks].tolist():
        if not kept or at - kept[-1] >= SHORTEST_STEP_S:
            kept.append(at)
    return np.array(kept)


def compass(imu: Array) -> Array:
    """Return the direction of body x, rad from magnetic east, of each sample with a magnetometer."""
    up = imu["acc"] / np.linalg.norm(imu["acc"], axis=1, keepdims=True)
    east = np.cross(imu["mag"], up)
    direction: Array = np.arctan2(_x(np.cross(up, east)), _x(east))
    return direction


def _x(axis: Array) -> Array:
    """Return the share of body x in an axis (n, 3)."""
    shares: Array = axis[:, 0] / np.linalg.norm(axis, axis=1)
    return shares


def _track(samples: Samples, places: Array, covs: Array) -> Track:
    ranges = samples.batch.ranges
    poses: Array = np.zeros(len(ranges), POSE)
    poses["t_ns"], poses["state"], poses["range"] = ranges["t_ns"], State.TRACKING, ranges["range"]
    poses["x"], poses["y"] = places.T
    poses["cov"][:, :2, :2] = covs
    return Track(ranges["t_ns"] / NS_PER_S, poses)

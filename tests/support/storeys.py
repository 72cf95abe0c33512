"""Simulated tags that change floors, doors that slam, and the sun: is the floor right, is a wrong one believed?"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dropanchor_evaluation.product.runs import TagRun
from dropanchor_schemas.plans import Floor
from dropanchor_service.estimation.columns import Array
from dropanchor_service.offline.replay import NS_PER_S, Track
from dropanchor_service.store.floors import Floors, floors_of
from support.climbs import Height

STOREY_M = 3.4
CARRIED_M = 1.2  # above the floor
BELIEVED = 0.9
SETTLED_S = 5.0  # after a change of the floor


def lift(t: Array) -> Array:
    """Return two storeys up at 1.5 m/s, a stay, and one down."""
    up, down = 2.0 * STOREY_M / 1.5, STOREY_M / 1.5
    return np.interp(t, [15.0, 15.0 + up, 40.0, 40.0 + down], [0.0, 2.0 * STOREY_M, 2.0 * STOREY_M, STOREY_M])


def slammed(run: TagRun, at_s: float = 30.0) -> TagRun:
    """Return the run with a door that slams: 2 hPa for a second."""
    pressures = run.samples.pressures.copy()
    t = pressures["t_ns"] / NS_PER_S
    pressures["pressure"][(t >= at_s) & (t < at_s + 1.0)] += 200.0
    return replace(run, samples=replace(run.samples, pressures=pressures))


def warmed(run: TagRun, pa_per_k: float, kelvin: float, at_s: float = 10.0, tau_s: float = 60.0) -> TagRun:
    """Return the run with a barometer that comes into the sun, and shows its own warmth as a change of pressure."""
    pressures = run.samples.pressures.copy()
    t = pressures["t_ns"] / NS_PER_S
    pressures["pressure"] += pa_per_k * kelvin * (1.0 - np.exp(-np.maximum(t - at_s, 0.0) / tau_s))
    return replace(run, samples=replace(run.samples, pressures=pressures))


@dataclass(frozen=True)
class FloorScore:
    """Numbers of poses. settled: later than SETTLED_S after a change of the floor. right: of these, the floor is right.

    believed: with a floor above BELIEVED. wrong: of these, another floor is the true one.
    """

    poses: int
    settled: int
    right: int
    believed: int
    wrong: int


def floor_score(tracks: Sequence[Track], heights: Sequence[Height]) -> FloorScore:
    """Compare the floors of the tracks with the true ones. Each tag begins CARRIED_M above its floor."""
    counts = np.zeros(5, np.int64)
    for track, height in zip(tracks, heights, strict=True):
        ground = float(height(np.zeros(1))[0]) - CARRIED_M
        number, probability = _house(ground).likeliest(track.poses)
        truth = np.floor((height(track.t) - ground) / STOREY_M).astype(np.int64) + 1  # the first floor is the cellar
        settled, believed = _is_settled(track.t, height), probability > BELIEVED
        right = number == truth
        of_track = (len(number), settled.sum(), (right & settled).sum(), believed.sum(), (believed & ~right).sum())
        counts += np.array(of_track)
    return FloorScore(*counts.tolist())


def _house(ground: float) -> Floors:
    """Return a cellar and three storeys. ground: m, of the lowest storey."""
    ends = [ground + STOREY_M * storey for storey in range(-1, 5)]
    return floors_of(Floor(name=str(n), bottom_m=ends[n], top_m=ends[n + 1]) for n in range(len(ends) - 1))


def _is_settled(t: Array, height: Height) -> Array:
    """Return whether the floor has not changed for SETTLED_S before each time."""
    storeys = [np.floor((height(t - back) - height(np.zeros(1)) + CARRIED_M) / STOREY_M) for back in _BACK_S]
    settled: Array = np.all([storey == storeys[0] for storey in storeys], axis=0)
    return settled


_BACK_S = np.arange(0.0, SETTLED_S + 0.01, 0.1)

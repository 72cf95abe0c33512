"""The floors of a site, and how likely each of them is for a height that is not exact."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_schemas.plans import Floor
from dropanchor_service.estimation.columns import Array, HeightSource
from dropanchor_service.estimation.heights import find_floors


@dataclass(frozen=True)
class Floors:
    """names: by number. bottom, top: m, ends of each range of heights, none of which overlaps another of its floor.

    number: of the floor of each range.
    """

    names: Sequence[str]
    bottom: Array
    top: Array
    number: Array

    def likeliest(self, poses: Array) -> tuple[Array, Array]:
        """Return the number of the likeliest floor of each POSE or POINT, and its probability.

        -1 and NaN where the height is not known, or more likely on none of the floors.
        """
        count = len(poses)
        found, probability = np.full(count, -1, np.int64), np.full(count, np.nan)
        if self.names:
            z = np.where(is_height_known(poses), poses["z"], np.nan)
            std = np.ascontiguousarray(poses["z_std"], np.float64)
            room = np.zeros(len(self.names))
            find_floors(z, std, self.bottom, self.top, self.number, room, found, probability)
        return found, probability


def is_height_known(poses: Array) -> Array:
    """Return whether the height of each POSE or POINT is one in the frame of the site."""
    known: Array = np.isfinite(poses["z"] + poses["z_std"]) & (poses["z_source"] != HeightSource.START)
    return known


def floors_of(floors: Iterable[Floor | None]) -> Floors:
    """Return these floors, the lowest first. Floors with the same name are one; ranges of theirs that overlap, too."""
    ranges: dict[str, list[tuple[float, float]]] = {}
    for floor in floors:
        if floor is not None:
            ranges.setdefault(floor.name, []).append((floor.bottom_m, floor.top_m))
    named = sorted((_joined(of_floor), name) for name, of_floor in ranges.items())
    flat = [(bottom, top, number) for number, (of_floor, _) in enumerate(named) for bottom, top in of_floor]
    columns = np.array(flat, np.float64).reshape(-1, 3).T.copy()
    return Floors([name for _, name in named], columns[0], columns[1], columns[2].astype(np.int64))


NO_FLOORS = floors_of(())


def _joined(ranges: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the same heights in ranges that do not overlap, in order."""
    joined: list[tuple[float, float]] = []
    for bottom, top in sorted(ranges):
        if joined and bottom <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(top, joined[-1][1]))
        else:
            joined.append((bottom, top))
    return joined

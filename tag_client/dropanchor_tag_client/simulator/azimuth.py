"""Azimuths of a tag as an anchor measures them, with white noise, errors that last, a field of view, and no behind."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropanchor_tag_client.simulator.ranging import AnchorPlace, Ranges
from dropanchor_tag_client.simulator.trajectory import Array, Trajectory


class Azimuths(NamedTuple):
    """Azimuths as columns (n,), in order of time. azimuth_rad: counter-clockwise from where the anchor faces.

    anchor: index of the anchor. std_rad: as it is reported.
    """

    t_s: Array
    anchor: NDArray[np.int64]
    azimuth_rad: Array
    std_rad: Array


@dataclass(frozen=True)
class AzimuthModel:
    """With each range, measured = azimuth + lasting · sin(2 · azimuth + phase) + white noise. Angles in rad.

    std: of the white noise. lasting: the greatest error that lasts as long as the tag is in one direction, as antennas
    have it; its phase is of the anchor. field: half of the field of view; beyond it there is no azimuth.
    is_folded: two antennas cannot tell behind from ahead. facing: where the anchors face, counter-clockwise from x.
    """

    std: float = math.radians(5.0)
    lasting: float = 0.0
    field: float = math.pi
    is_folded: bool = False
    facing: float = 0.0

    def measure(
        self, motion: Trajectory, ranges: Ranges, anchors: Sequence[AnchorPlace], rng: np.random.Generator
    ) -> Azimuths:
        """Return the azimuths that come with these ranges."""
        there = motion.at(ranges.t_s)
        x, y = (np.array([getattr(anchor, axis) for anchor in anchors])[ranges.anchor] for axis in "xy")
        true = _wrapped(np.arctan2(there.y - y, there.x - x) - self.facing)
        seen = np.where(np.abs(true) > math.pi / 2, _wrapped(math.pi - true), true) if self.is_folded else true
        phase = np.arange(len(anchors))[ranges.anchor]
        noise = self.std * rng.standard_normal(len(seen))
        measured = _wrapped(seen + self.lasting * np.sin(2.0 * seen + phase) + noise)
        told = np.full(len(seen), math.hypot(self.std, self.lasting))
        inside = np.abs(true) <= self.field
        return Azimuths(ranges.t_s[inside], ranges.anchor[inside], measured[inside], told[inside])


def _wrapped(angles: Array) -> Array:
    wrapped: Array = np.remainder(angles + math.pi, math.tau) - math.pi
    return wrapped

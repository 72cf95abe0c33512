"""Slant ranges to anchors, with white noise, NLOS excess, dropouts and delay."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropanchor_tag_client.simulator.trajectory import Array, Trajectory


class AnchorPlace(NamedTuple):
    """An anchor and its position, m."""

    id: str = "1"
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Ranges(NamedTuple):
    """Ranges as columns (n,), in order of time. anchor: index of the anchor; std_m: as the sensor reports it."""

    t_s: Array
    anchor: NDArray[np.int64]
    range_m: Array
    std_m: Array

    def where(self, rows: NDArray[Any]) -> "Ranges":
        """Return the rows that a mask or indices select."""
        return Ranges(self.t_s[rows], self.anchor[rows], self.range_m[rows], self.std_m[rows])


@dataclass(frozen=True)
class RangeModel:
    """measured = scale · slant distance + bias + white noise + NLOS excess. Lengths in m, durations in s.

    hz: rate per anchor; None: a range at every instant of the motion.
    nlos_share: share of single ranges with an excess of U(nlos_m).
    burst_count: number of bursts of U(burst_s), each with one constant excess of U(nlos_m).
    dropout_share: share of lost ranges. outage_s: duration of one stretch without ranges.
    delay_s: a range with the time stamp t was measured at t - delay_s.
    """

    hz: float | None = None
    std: float = 0.2
    bias: float = 0.0
    scale: float = 1.0
    nlos_share: float = 0.0
    nlos_m: tuple[float, float] = (0.3, 2.0)
    burst_count: int = 0
    burst_s: tuple[float, float] = (1.0, 3.0)
    dropout_share: float = 0.0
    outage_s: float = 0.0
    delay_s: float = 0.0

    def measure(
        self, motion: Trajectory, height: float, anchors: Sequence[AnchorPlace], rng: np.random.Generator
    ) -> Ranges:
        """Return the ranges to all anchors over a motion at a constant height. Anchors alternate."""
        hz = self.hz or 1.0 / motion.dt
        count = len(anchors)
        parts = [
            self._to_anchor(motion, height, index, anchor, (hz, index / (hz * count)), rng)
            for index, anchor in enumerate(anchors)
        ]
        t_s, which, range_m = (np.concatenate(column) for column in zip(*parts, strict=True))
        range_m = range_m + self._bursts(t_s, rng)
        ranges = Ranges(t_s, which, np.maximum(range_m, 0.0), np.full(len(t_s), self.std))
        received = ranges.where(self._received(t_s, rng))
        return received.where(np.argsort(received.t_s, kind="stable"))

    def _to_anchor(
        self,
        motion: Trajectory,
        height: float,
        index: int,
        anchor: AnchorPlace,
        timing: tuple[float, float],
        rng: np.random.Generator,
    ) -> tuple[Array, NDArray[np.int64], Array]:
        t_s = sample_times(motion, *timing)
        there = motion.at(t_s - self.delay_s)
        distance = np.sqrt((there.x - anchor.x) ** 2 + (there.y - anchor.y) ** 2 + (height - anchor.z) ** 2)
        noise = self.std * rng.standard_normal(len(t_s))
        nlos = rng.random(len(t_s)) < self.nlos_share
        excess = np.where(nlos, rng.uniform(*self.nlos_m, len(t_s)), 0.0)
        return t_s, np.full(len(t_s), index), self.scale * distance + self.bias + noise + excess

    def _bursts(self, t_s: Array, rng: np.random.Generator) -> Array:
        excess = np.zeros(len(t_s))
        for _ in range(self.burst_count):
            first = rng.uniform(t_s.min(), t_s.max() - self.burst_s[1])
            inside = (t_s >= first) & (t_s < first + rng.uniform(*self.burst_s))
            excess[inside] = rng.uniform(*self.nlos_m)
        return excess

    def _received(self, t_s: Array, rng: np.random.Generator) -> NDArray[np.bool_]:
        received = rng.random(len(t_s)) >= self.dropout_share
        if self.outage_s:
            # Not within the first 5 s: the ranges start before the outage.
            first = rng.uniform(t_s.min() + 5.0, t_s.max() - self.outage_s)
            received &= (t_s < first) | (t_s >= first + self.outage_s)
        return received


def sample_times(motion: Trajectory, hz: float, offset: float = 0.0) -> Array:
    """Return the instants k / hz + offset, k = 0, 1, …, within a motion, both ends included."""
    slack = 1e-6
    first = int(np.ceil((motion.t[0] - offset) * hz - slack))
    last = int(np.floor((motion.t[-1] - offset) * hz + slack))
    times: Array = offset + np.arange(first, last + 1) / hz
    return times

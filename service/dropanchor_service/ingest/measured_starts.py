"""Where a tag is whose anchor measures its azimuth: a range and an azimuth are a start that nobody has to tell."""

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array, SampleBatch
from dropanchor_service.ingest.anchors import AnchorTable

LEAST = 5  # azimuths, and ranges
LEAST_NS, LONGEST_NS = 500_000_000, 1_500_000_000  # from the first to the last of them
UNKNOWN_STD = math.radians(10.0)
LEAST_STD_M = 0.3
LASTING = 17.0  # root of 10 Hz · 30 s, in which the mean of azimuths is to be as unsure as one
AGREE = 3.0  # standard deviations: azimuths that differ by more are reflections


class _Seen(NamedTuple):
    """One sample. value: m or rad."""

    t_ns: int
    anchor: int
    value: float
    std: float


class MeasuredStart(NamedTuple):
    """A place where a tag starts, m, and the one where it may start as well: its mirror image behind the anchor."""

    place: tuple[float, float]
    std_m: float
    other: tuple[float, float] | None

    def told_to(self, settings: Array) -> Array:
        """Return TAG_SETTINGS with this start."""
        settings["start_known"], settings["start_std"] = True, self.std_m
        settings["start_x"], settings["start_y"] = self.place
        settings["start_other_x"], settings["start_other_y"] = self.other or (math.nan, math.nan)
        return settings


class MeasuredStarts:
    """Rows whose start is not known, with their last ranges and azimuths. Owned by the ingest thread."""

    def __init__(self) -> None:
        self._open: set[int] = set()
        self._ranges: dict[int, list[_Seen]] = defaultdict(list)
        self._azimuths: dict[int, list[_Seen]] = defaultdict(list)

    def begin(self, row: int, is_known: bool) -> None:
        """Look for the start of a row that starts afresh, unless it is known."""
        self.end(row)
        if not is_known:
            self._open.add(row)

    def end(self, row: int) -> None:
        """Look no more for the start of a row."""
        self._open.discard(row)
        self._ranges.pop(row, None)
        self._azimuths.pop(row, None)

    def look(self, samples: SampleBatch, anchors: AnchorTable, heights: Array) -> Iterator[tuple[int, MeasuredStart]]:
        """Yield the rows whose start these samples tell. heights: m, by row."""
        if not self._open or not (len(samples.bearings) or self._azimuths):
            return
        azimuths = samples.bearings[np.isfinite(anchors.places["facing"][samples.bearings["anchor"]])]
        measured = set(azimuths["row"].tolist()) & self._open
        self._note(azimuths, "bearing", self._azimuths, measured)
        self._note(samples.ranges, "range", self._ranges, measured | self._azimuths.keys())
        for row in measured:
            start = _start(self._ranges[row], self._azimuths[row], anchors.places, float(heights[row]))
            if start is not None:
                self.end(row)
                yield row, start

    def _note(self, samples: Array, value: str, kept: dict[int, list[_Seen]], rows: set[int]) -> None:
        """Keep the samples of these rows, for a while."""
        chosen = samples[np.isin(samples["row"], list(rows))]
        for row, t_ns, anchor, seen, std in chosen[["row", "t_ns", "anchor", value, "std"]].tolist():
            kept[row] = [*(one for one in kept[row] if one.t_ns > t_ns - LONGEST_NS), _Seen(t_ns, anchor, seen, std)]


def with_lasting_errors(samples: SampleBatch, anchors: AnchorTable) -> SampleBatch:
    """Return the samples with the standard deviation that azimuths need whose errors last.

    The engine takes errors for independent: of a hundred azimuths it would believe the mean to a tenth of their error.
    """
    are_azimuths = np.isfinite(anchors.places["facing"][samples.bearings["anchor"]])
    if not are_azimuths.any():
        return samples
    bearings = samples.bearings.copy()
    told = bearings["std"][are_azimuths]
    bearings["std"][are_azimuths] = LASTING * np.where(told > 0.0, told, UNKNOWN_STD)
    return replace(samples, bearings=bearings)


def _start(ranges: list[_Seen], azimuths: list[_Seen], anchors: Array, height: float) -> MeasuredStart | None:
    """Return the place that ranges to and azimuths from one anchor agree on, None where they are too few or differ.

    The errors of azimuths last, so their mean is no better than one of them.
    """
    anchor = azimuths[-1].anchor
    mine, far = ([one for one in kept if one.anchor == anchor] for kept in (azimuths, ranges))
    if min(len(mine), len(far)) < LEAST or mine[-1].t_ns - mine[0].t_ns < LEAST_NS:
        return None
    angles = np.array([one.value for one in mine])
    middle = math.atan2(np.sin(angles).mean(), np.cos(angles).mean())
    told = float(np.median([one.std if one.std > 0.0 else UNKNOWN_STD for one in mine]))
    spread = float(np.sqrt(np.mean((np.remainder(angles - middle + math.pi, math.tau) - math.pi) ** 2)))
    if spread > AGREE * told:
        return None
    place = anchors[anchor]
    slant = float(np.median([one.value for one in far]))
    level = math.sqrt(max(slant**2 - (height - float(place["z"])) ** 2, 0.0))

    def seen(azimuth: float) -> tuple[float, float]:
        return float(place["x"]) + level * math.cos(azimuth), float(place["y"]) + level * math.sin(azimuth)

    behind = 2.0 * float(place["facing"]) + math.pi - middle
    return MeasuredStart(
        seen(middle), max(LEAST_STD_M, slant * max(told, spread)), seen(behind) if place["mirrors"] else None
    )

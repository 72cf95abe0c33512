"""The engine `paper`: Algorithm 1 of "Accurate position tracking with a single UWB anchor", one instance per tag.

It is written to be read beside the paper, not to be fast. Its filter has one mode and does not know the mirror image of
its track, so `p_mode` and `sigma_obs` of its poses are NaN.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from operator import itemgetter
from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import (
    INNOVATION,
    POSE,
    Array,
    MeasurementKind,
    PoseBatch,
    SampleBatch,
)
from dropanchor_service.estimation.paper.algorithm1 import Algorithm1, PoseValues
from dropanchor_service.estimation.paper.parameters import PaperParameters
from dropanchor_service.estimation.paper.tag import Tag

IMU, HEADING, RANGE = range(3)  # the order in which samples of the same instant are taken
KINDS = ("imu", "heading", "range")
ABSURD = 1e6  # in any unit of a sample
Event = tuple[int, int, int, tuple[Any, ...]]
"""Row, t_ns, kind, the rest of the sample."""


class PaperEngine:
    """Implement `Engine`."""

    name = "paper"

    def __init__(self, parameters: PaperParameters) -> None:
        self._parameters = parameters
        self._anchors: list[tuple[float, float, float]] = []
        self._tags: dict[int, Tag] = {}
        self._filters: dict[int, Algorithm1] = {}
        self._times: dict[int, int] = {}  # of the newest sample of each row, ns

    def set_anchors(self, anchors: Array) -> None:
        """Set ANCHOR, which the `anchor` columns of samples index."""
        self._anchors = anchors[["x", "y", "z"]].tolist()

    def configure(self, row: int, settings: Array) -> None:
        """Make `row` with these TAG_SETTINGS (0-d), or start it again with new ones."""
        self._tags[row] = Tag.of(settings)
        self._filters[row] = Algorithm1(self._parameters, self._tags[row])
        self._times.pop(row, None)

    def process(self, samples: SampleBatch) -> PoseBatch:
        """Take the samples of each row in order of time. A sample older than its row's newest is late and not used.

        Bearings are not part of the paper and are ignored.
        """
        rejected: dict[str, list[int]] = {}
        unused: dict[str, list[int]] = {}
        poses: list[PoseValues] = []
        innovations: list[tuple[Any, ...]] = []
        with np.errstate(all="ignore"):  # numbers out of range are a fault of their row, not a warning
            for event in _in_order(samples):
                reason = self._rejection(event)
                if reason is not None:
                    rejected.setdefault(reason, []).append(event[0])
                    unused.setdefault(KINDS[event[2]], []).append(event[0])
                    continue
                pose = self._take(event)
                if pose is not None:
                    poses.append({"row": event[0]} | pose)
                    innovations.extend(self._innovation(event))
        return PoseBatch(
            _poses(poses),
            innovations=np.array(innovations, INNOVATION),
            rejected={reason: np.array(rows, np.int32) for reason, rows in rejected.items()},
            unused={kind: np.array(rows, np.int32) for kind, rows in unused.items()},
        )

    def _innovation(self, event: Event) -> Iterator[tuple[Any, ...]]:
        """Yield INNOVATION of a range that met a belief, in metres as measured."""
        row, t_ns, _, (anchor, measured, _) = event
        innovation = self._filters[row].innovation
        if innovation is not None:
            scale = self._tags[row].range_scale
            y = innovation.y * scale
            S = innovation.S * scale**2
            values = (anchor, measured, measured - y, y, S, math.nan, innovation.fused, math.nan, math.nan)
            yield row, t_ns, MeasurementKind.RANGE, *values

    def _rejection(self, event: Event) -> str | None:
        """Return why a sample is not used, or None. The ingest screens values first; this keeps the state safe."""
        row, t_ns, kind, values = event
        if t_ns < self._times.get(row, t_ns):
            return "late"
        if kind == RANGE and not 0 <= values[0] < len(self._anchors):
            return "anchor_unknown"
        return _fault_of(kind, values)

    def _take(self, event: Event) -> PoseValues | None:
        """Take one sample into its row. Numbers that overflow cost that row its state, and no other row anything."""
        row, t_ns, kind, _ = event
        self._times[row] = t_ns
        try:
            pose = self._fuse(event)
            healthy = self._filters[row].finite
        except (ArithmeticError, ValueError):
            healthy = False
        if healthy:
            return pose
        self._filters[row] = Algorithm1(self._parameters, replace(self._tags[row], start_known=False), faulted=True)
        return self._filters[row].pose_before_start(t_ns) if kind == RANGE else None

    def _fuse(self, event: Event) -> PoseValues | None:
        row, t_ns, kind, values = event
        tag_filter = self._filters[row]
        if kind == IMU:
            tag_filter.take_imu(t_ns, *values)
            return None
        if kind == HEADING:
            tag_filter.take_heading(t_ns, *values)
            return None
        index, measured, std = values
        x, y, z = self._anchors[index]
        return tag_filter.take_range(t_ns, index, (x, y, z - self._tags[row].height), measured, std)


def _poses(rows: list[PoseValues]) -> Array:
    """Return POSE of these values. What the engine leaves out is NaN, or 0 where it is a number of a choice."""
    poses = np.zeros(len(rows), POSE)
    for name in POSE.names or ():
        unknown = np.nan if POSE[name].base.kind == "f" else 0
        for pose, values in zip(poses, rows, strict=True):
            pose[name] = values.get(name, unknown)
    return poses


def _in_order(samples: SampleBatch) -> Iterator[Event]:
    """Yield all samples by row, then time, then kind, then arrival."""
    events: list[Event] = []
    for kind, columns, names in (
        (IMU, samples.imu, ("acc", "gyro", "mag")),
        (HEADING, samples.headings, ("heading", "std")),
        (RANGE, samples.ranges, ("anchor", "range", "std")),
    ):
        values = zip(*(columns[name].tolist() for name in names), strict=True)
        rows, times = columns["row"].tolist(), columns["t_ns"].tolist()
        events.extend((row, t_ns, kind, v) for row, t_ns, v in zip(rows, times, values, strict=True))
    events.sort(key=itemgetter(0, 1, 2))
    yield from events


def _fault_of(kind: int, values: tuple[Any, ...]) -> str | None:
    """Return what is wrong with the numbers of a sample, or None. A magnetic field and a std may be missing."""
    needed = (*values[0], *values[1]) if kind == IMU else values[:1] if kind == HEADING else values[1:2]
    if not all(map(math.isfinite, needed)):
        return "not_finite"
    if max(map(abs, needed)) > ABSURD:
        return ("imu_absurd", "heading_absurd", "range_absurd")[kind]
    return None

"""Watch the tags whose motion and ranges come from two publishers, and estimate the offset of their clocks."""

from collections import deque
from collections.abc import Iterator, Mapping
from itertools import islice

import numpy as np

from dropanchor_service.estimation.columns import Array, SampleBatch
from dropanchor_service.ingest.motion_offsets.agreement import agreed
from dropanchor_service.ingest.motion_offsets.bins import TagBins
from dropanchor_service.ingest.motion_offsets.fit import MAX_LAG_BINS, Minimum, fit
from dropanchor_service.store.clock_offsets import MotionOffset

MAX_TAGS = 64
WINDOW_BINS = 200
STEP_BINS = 100
WINDOWS = 10


class WatchedTag:
    """The samples of one tag and the results of its last windows.

    moved_ns: what was added to the times of its motion.
    """

    def __init__(self, moved_ns: int) -> None:
        self.moved_ns = moved_ns
        self.bins = TagBins()
        self.offset: MotionOffset | None = None
        self._end = 0  # of the last window, number of a bin
        self._windows: deque[tuple[int, Minimum | None]] = deque(maxlen=WINDOWS)

    @property
    def is_due(self) -> bool:
        """Whether 10 s have passed since the end of the last window."""
        return self._newest_end() >= self._end + STEP_BINS

    def estimate(self) -> None:
        """Fit the newest window, and combine it with those of the last 100 s."""
        self._end = end = self._newest_end()
        first = end - WINDOW_BINS
        motion = self.bins.motion(first - MAX_LAG_BINS, end + MAX_LAG_BINS)
        told = None if motion is None else fit(motion, self.bins.mean_ranges(first, end))
        self._windows.append((end, told))
        recent = [window for window_end, window in self._windows if window_end > end - WINDOWS * STEP_BINS]
        self.offset = agreed(recent)

    def _newest_end(self) -> int:
        return min(self.bins.imu.newest - MAX_LAG_BINS, self.bins.ranges.newest)


class MotionOffsets:
    """Offsets of the clocks of up to MAX_TAGS tags. Owned by the ingest thread; any thread may call `offset`.

    A call of `add` fits one window at most, so that it takes milliseconds at most.
    """

    def __init__(self) -> None:
        self._tags: dict[int, WatchedTag] = {}
        self._is_watched = np.zeros(1, np.bool_)  # of each row; the last one stands for all higher rows

    def watch(self, rows: Mapping[int, int]) -> None:
        """Watch these rows and forget the others. rows: what is added to the times of their motion, ns."""
        self._tags = {row: self._watched(row, moved_ns) for row, moved_ns in islice(rows.items(), MAX_TAGS)}
        self._is_watched = np.zeros(max(self._tags, default=-1) + 2, np.bool_)
        self._is_watched[list(self._tags)] = True

    def offset(self, row: int) -> MotionOffset | None:
        """Return how far the clock of a tag's motion is ahead of that of its ranges, None if that is not known."""
        tag = self._tags.get(row)
        if tag is None or tag.offset is None:
            return None
        return tag.offset._replace(offset_s=tag.offset.offset_s - tag.moved_ns * 1e-9)

    def _watched(self, row: int, moved_ns: int) -> WatchedTag:
        known = self._tags.get(row)
        return known if known is not None and known.moved_ns == moved_ns else WatchedTag(moved_ns)

    def add(self, samples: SampleBatch) -> None:
        """Add the samples of the tags that are watched."""
        if not self._tags:
            return
        for row, imu in self._of_tags(samples.imu):
            self._tags[row].bins.add_imu(imu["t_ns"], imu["acc"], imu["gyro"])
        touched = []
        for row, ranges in self._of_tags(samples.ranges):
            self._tags[row].bins.add_ranges(ranges["t_ns"], ranges["anchor"], ranges["range"])
            touched.append(row)
        due = next((self._tags[row] for row in touched if self._tags[row].is_due), None)
        if due is not None:
            due.estimate()

    def _of_tags(self, column: Array) -> Iterator[tuple[int, Array]]:
        """Yield the row and the samples of each tag that is watched and has any."""
        chosen = column[self._is_watched[np.minimum(column["row"], len(self._is_watched) - 1)]]
        for row in np.unique(chosen["row"]).tolist():
            yield row, chosen[chosen["row"] == row]

"""Estimate from a whole recording how far the clock of the IMU is ahead of that of the ranges.

The windows are those of the live service (`ingest/motion_offsets`), but closer together, and all of them count.
"""

import numpy as np

from dropanchor_service.estimation.columns import Array, SampleBatch
from dropanchor_service.ingest.motion_offsets.agreement import MAX_DEVIATION_S, agreed
from dropanchor_service.ingest.motion_offsets.bins import BIN_NS, TagBins
from dropanchor_service.ingest.motion_offsets.fit import MAX_LAG_BINS, Minimum, fit
from dropanchor_service.ingest.motion_offsets.watch import WINDOW_BINS
from dropanchor_service.store.clock_offsets import TOO_LARGE_S, MotionOffset

STEP_BINS = 50
MAX_WINDOWS = 120
MAX_OTHERS = 0.1  # share of the windows that tell something else
MAX_UNCERTAINTY_S = 0.3  # walks whose windows agree by chance showed 0.5 s
SHIFTS_S = (0.0, 5.0, -5.0, 10.0, -10.0)  # one fit finds lags up to 3 s
_EPOCH_NS = 10**12  # the bins begin after 0


def motion_offset(batch: SampleBatch) -> MotionOffset | None:
    """Return the offset, None where the motion does not tell for certain."""
    if not len(batch.imu) or not len(batch.ranges):
        return None
    for shift_s in SHIFTS_S:
        found = _agreed(_windows(batch, round(shift_s * 1e9)))
        if found is not None:
            is_certain = found.uncertainty_s <= MAX_UNCERTAINTY_S
            return found._replace(offset_s=found.offset_s + shift_s) if is_certain else None
    return None


def is_large(offset: MotionOffset) -> bool:
    """Return whether there is an offset for certain, and it harms the track."""
    return abs(offset.offset_s) > max(TOO_LARGE_S, offset.uncertainty_s)


def _agreed(windows: list[Minimum | None]) -> MotionOffset | None:
    """Return what most windows agree on."""
    told = [window.lag_s for window in windows if window is not None]
    if not told:
        return None
    middle_s = float(np.median(told))
    kept = [w if w is None or abs(w.lag_s - middle_s) <= MAX_DEVIATION_S else None for w in windows]
    others = len(told) - sum(window is not None for window in kept)
    return agreed(kept) if others <= MAX_OTHERS * len(told) else None


def _windows(batch: SampleBatch, shift_ns: int) -> list[Minimum | None]:
    """Fit the windows of the recording, with the IMU moved back by the shift."""
    start_ns = min(int(batch.imu["t_ns"][0]), int(batch.ranges["t_ns"][0])) - _EPOCH_NS
    imu_ns, range_ns = batch.imu["t_ns"] - start_ns - shift_ns, batch.ranges["t_ns"] - start_ns
    first = max(int(imu_ns[0]) // BIN_NS + MAX_LAG_BINS, int(range_ns[0]) // BIN_NS)
    last = min(int(imu_ns[-1]) // BIN_NS - MAX_LAG_BINS, int(range_ns[-1]) // BIN_NS) - WINDOW_BINS
    step = max(STEP_BINS if shift_ns == 0 else 2 * STEP_BINS, (last - first) // MAX_WINDOWS)
    return [_window(batch, imu_ns, range_ns, begin) for begin in range(first, last + 1, step)]


def _window(batch: SampleBatch, imu_ns: Array, range_ns: Array, first: int) -> Minimum | None:
    end, bins = first + WINDOW_BINS, TagBins()
    of_imu = _slice(imu_ns, first - MAX_LAG_BINS, end + MAX_LAG_BINS)
    of_ranges = _slice(range_ns, first, end)
    imu, ranges = batch.imu[of_imu], batch.ranges[of_ranges]
    if not len(imu) or not len(ranges):
        return None
    own = ranges["anchor"] == np.bincount(ranges["anchor"]).argmax()
    bins.add_imu(imu_ns[of_imu], imu["acc"], imu["gyro"])
    bins.add_ranges(range_ns[of_ranges][own], ranges["anchor"][own], ranges["range"][own])
    motion = bins.motion(first - MAX_LAG_BINS, end + MAX_LAG_BINS)
    return None if motion is None else fit(motion, bins.mean_ranges(first, end))


def _slice(t_ns: Array, first: int, end: int) -> slice:
    begin, stop = np.searchsorted(t_ns, [first * BIN_NS, end * BIN_NS])
    return slice(int(begin), int(stop))

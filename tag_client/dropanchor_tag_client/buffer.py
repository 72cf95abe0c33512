"""The buffer of samples that the client sends in its next message."""

import math
from collections.abc import Sequence

from dropanchor_schemas.keys import checked_id
from dropanchor_schemas.kinds import KIND_OF, Frame, ImuSample, Sample
from dropanchor_schemas.wire import MAX_T_NS, Reason, Vector, anchor_number

# Packed payloads count microseconds in 32 bits (4,294 s). This limit stays far below that.
_MAX_SPAN_NS = 60_000_000_000
_MAX_FLOAT32 = 3.4028234663852886e38


class SampleBuffer:
    """Collect samples into a frame. Not thread-safe: the owner holds a lock."""

    def __init__(self, max_samples: int) -> None:
        self.max_samples = max_samples
        self._frame = Frame()
        self._first_ns = 0

    def __len__(self) -> int:
        return len(self._frame)

    @property
    def is_full(self) -> bool:
        return len(self._frame) >= self.max_samples

    def accepts(self, t_ns: int) -> bool:
        """Return whether a sample of this time fits into the same message as the buffered samples."""
        return not len(self._frame) or abs(t_ns - self._first_ns) <= _MAX_SPAN_NS

    def add(self, sample: Sample, anchor: int | str | None = None) -> None:
        if not len(self._frame):
            self._first_ns = sample.t_ns
        kind = KIND_OF[type(sample)]
        getattr(self._frame, kind.field).append(sample)
        if isinstance(anchor, str):
            self._frame.anchor_names[anchor_number(anchor)] = anchor

    def take(self) -> Frame:
        """Return the buffered samples and empty the buffer."""
        frame, self._frame = self._frame, Frame()
        return frame


def rejection_reason(sample: Sample) -> Reason | None:
    """Return why a payload cannot hold this sample, or None if it can. A standard deviation of NaN means unknown."""
    if not 0 <= sample.t_ns < MAX_T_NS:
        return Reason.TIME_OUT_OF_RANGE
    if isinstance(sample, ImuSample):
        values, std = (*sample.acc, *sample.gyro, *(sample.mag or ())), math.nan
    else:
        values, std = (sample[-2],), sample[-1]
    if not all(abs(value) <= _MAX_FLOAT32 for value in values):
        return Reason.NOT_FINITE
    return Reason.STD_INVALID if abs(std) > _MAX_FLOAT32 else None


def number_of(anchor: int | str) -> int:
    """Return the number of an anchor in packed payloads. Raises ValueError if the id cannot be one."""
    return anchor_number(checked_id(anchor) if isinstance(anchor, str) else anchor)


def vector(name: str, values: Sequence[float]) -> Vector:
    """Return three components as floats. Raises ValueError for another number of them."""
    if len(values) != 3:
        raise ValueError(f"{name} has three components, not {len(values)}")
    return float(values[0]), float(values[1]), float(values[2])

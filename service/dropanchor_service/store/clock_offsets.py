"""How far the clock of a tag's motion is ahead of that of its ranges."""

from typing import Any, NamedTuple, Protocol

LEAST_DELAYS_S = 0.1  # by which the least delays of the messages of two publishers may differ
TOO_LARGE_S = 0.2  # a person walks 0.3 m in this time


class MotionOffset(NamedTuple):
    """An estimate from what motion and ranges say while the tag moves. uncertainty_s: 95 %."""

    offset_s: float
    uncertainty_s: float


class ClockOffset(NamedTuple):
    """offset_s: motion minus ranges, from message times. uncertainty_s: the offset lies within this much of it.

    from_motion: None while the motion does not tell. corrected: whether the times of the motion are moved by it.
    """

    offset_s: float
    uncertainty_s: float
    from_motion: MotionOffset | None = None
    corrected: bool = False

    @property
    def is_too_large(self) -> bool:
        """Whether the offset harms the track for certain."""
        return abs(self.offset_s) - self.uncertainty_s > TOO_LARGE_S

    def answer(self) -> dict[str, Any]:
        """Return the `ClockOffset` of the contract."""
        motion = self.from_motion
        return self._asdict() | {"from_motion": None if motion is None else motion._asdict()}

    @property
    def disagrees(self) -> bool:
        """Whether message times and motion contradict each other, so that a network delays one side."""
        motion = self.from_motion
        if motion is None:
            return False
        return abs(self.offset_s - motion.offset_s) > self.uncertainty_s + motion.uncertainty_s


class ClockOffsets(Protocol):
    """Where the offsets are read. Thread-safe. now_ns: UTC."""

    def clock_offset(self, row: int, now_ns: int) -> ClockOffset | None: ...

    def clock_offsets(self, now_ns: int) -> dict[int, ClockOffset]: ...


class NoClockOffsets:
    """Knows no offset of any tag."""

    def clock_offset(self, _row: int, _now_ns: int) -> ClockOffset | None:
        return None

    def clock_offsets(self, _now_ns: int) -> dict[int, ClockOffset]:
        return {}

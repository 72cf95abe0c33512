"""How far the clock of a tag's motion is ahead of that of its ranges, where two programs or devices send them."""

from typing import NamedTuple, Protocol

LEAST_DELAYS_S = 0.1  # by which the least delays of the messages of two publishers may differ
TOO_LARGE_S = 0.2  # a person walks 0.3 m in this time


class ClockOffset(NamedTuple):
    """offset_s: motion minus ranges. uncertainty_s: the offset lies within this much of it."""

    offset_s: float
    uncertainty_s: float

    @property
    def is_too_large(self) -> bool:
        """Whether the offset harms the track for certain."""
        return abs(self.offset_s) - self.uncertainty_s > TOO_LARGE_S


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

"""Find when there are poses: a period in equal parts, each with or without any.

Each part is one search in an index, so the size of the history does not matter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from dropanchor_service.history.records import SLOT_NS
from dropanchor_service.history.stored import StoredTracks


@dataclass(frozen=True)
class Coverage:
    """When there are poses. step_ns: the length of a part. stretches: start and end of each, end excluded, in order."""

    step_ns: int
    stretches: list[tuple[int, int]]


NO_COVERAGE = Coverage(SLOT_NS, [])


def read_coverage(stored: StoredTracks, from_ns: int, to_ns: int, max_parts: int) -> Coverage:
    """Return when there are poses from one time to another, in at most `max_parts` parts of whole slots.

    What lies before the first and after the last pose of all is not divided. Raises the errors of `StoredTracks`.
    """
    oldest_ns, newest_ns = stored.span() or (0, 0)
    first, after = max(from_ns, oldest_ns) // SLOT_NS, min(to_ns, newest_ns - 1) // SLOT_NS + 1
    if first >= after:
        return NO_COVERAGE
    slots = -(-(after - first) // max_parts)
    parts = stored.filled_parts(first, slots, -(-(after - first) // slots))
    step_ns = slots * SLOT_NS
    return Coverage(step_ns, [(first * SLOT_NS + a * step_ns, first * SLOT_NS + b * step_ns) for a, b in _runs(parts)])


def _runs(parts: Sequence[int]) -> list[tuple[int, int]]:
    """Return the first number and the one after the last of each run of consecutive numbers."""
    if not parts:
        return []
    breaks = [(before + 1, after) for before, after in pairwise(parts) if after > before + 1]
    starts = [parts[0], *(after for _, after in breaks)]
    return list(zip(starts, [*(end for end, _ in breaks), parts[-1] + 1], strict=True))

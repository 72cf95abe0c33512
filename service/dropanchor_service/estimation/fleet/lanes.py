"""The threads that share the rows of a batch. Kernels release the interpreter's lock, so that each has a core."""

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Final, TypeVar

from dropanchor_service.estimation.columns import Array

PART_SAMPLES: Final = 512  # at least, of a part: about a millisecond, ten times what handing it over costs
PARTS_PER_LANE: Final = 4  # so that lanes end together although some rows cost more than others

Result = TypeVar("Result")


class Lanes:
    """So many threads, one of which is the caller's. Lane 0 is the caller."""

    def __init__(self, count: int) -> None:
        self.count = count
        self._others = ThreadPoolExecutor(count - 1, "engine") if count > 1 else None

    def run(self, jobs: Sequence[Callable[[int], Result]]) -> list[Result]:
        """Run the jobs, which are given the number of their lane. Return what they return, in their order.

        Raises what one of them raises, once all lanes have ended.
        """
        if self._others is None or len(jobs) < 2:
            return [job(0) for job in jobs]
        results: list[Result | None] = [None] * len(jobs)
        following = itertools.count()

        def work(lane: int) -> None:
            while (index := next(following)) < len(jobs):
                results[index] = jobs[index](lane)

        others = [self._others.submit(work, lane) for lane in range(1, min(self.count, len(jobs)))]
        try:
            work(0)
        finally:
            wait(others)
        for other in others:
            other.result()
        return [result for result in results if result is not None]

    def cut(self, order: Array, imu_rows: Array, event_rows: Array) -> list[slice]:
        """Cut the samples of a batch between rows. order: indices into imu_rows and, behind them, event_rows."""
        parts = min(PARTS_PER_LANE * self.count, len(order) // PART_SAMPLES) if self._others else 1
        if parts < 2:
            return [slice(0, len(order))]

        def row_at(place: int) -> int:
            index = int(order[place]) - len(imu_rows)
            return int(event_rows[index] if index >= 0 else imu_rows[index])

        ends = [0]
        for part in range(1, parts):
            end = max(part * len(order) // parts, ends[-1] + 1)
            while end < len(order) and row_at(end) == row_at(end - 1):
                end += 1
            ends.append(end)
        ends = [*dict.fromkeys(end for end in ends if end < len(order)), len(order)]
        return [slice(*pair) for pair in itertools.pairwise(ends)]

"""Run independent tasks on several processes. Results keep the order of the tasks, so reports are reproducible."""

import multiprocessing
import multiprocessing.pool
import signal
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")


class Workers:
    """A pool of processes as a context manager; they end with it, also on Ctrl-C. With 1, tasks run in this process."""

    def __init__(self, processes: int) -> None:
        self._processes = processes
        self._pool: multiprocessing.pool.Pool | None = None

    def __enter__(self) -> "Workers":
        if self._processes > 1:
            # spawn: threads of this process (numba, Zenoh) do not survive a fork
            self._pool = multiprocessing.get_context("spawn").Pool(self._processes, leave_interrupts_to_parent)
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.terminate()
            self._pool.join()

    def map(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[Result]:
        """Yield the results in the order of the tasks, each as soon as it is available."""
        return map(function, tasks) if self._pool is None else self._pool.imap(function, tasks)


def leave_interrupts_to_parent() -> None:
    """Ignore Ctrl-C in a process of a pool: the parent ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

"""Read the CPU time and memory of a process from the kernel, and throttle a process."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

_PERIOD_S = 0.02  # of one stop and one continuation
_TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


def cpu_s(pid: int) -> float:
    """Return the user and system time of all threads of a process so far, in s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * _TICK_S


def children_cpu_s(pid: int) -> float:
    """Return the user and system time of the children of a process that have ended, in s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[13]) + int(fields[14])) * _TICK_S


def thread_s(pid: int) -> float:
    """Return the time that the threads of a process which live now have run, in s: finer than ticks."""
    files = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(file.read_text().split()[0]) for file in files) * 1e-9


def resident_bytes(pid: int) -> int:
    """Return the resident memory of a process."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def written_bytes(pid: int) -> int:
    """Return how many bytes a process has had written to disks so far."""
    lines = Path(f"/proc/{pid}/io").read_text().splitlines()
    return int(next(line.split(": ")[1] for line in lines if line.startswith("write_bytes")))


def load() -> float:
    """Return the load average of the last minute."""
    return os.getloadavg()[0]


@contextmanager
def throttled(pid: int, share: float) -> Iterator[None]:
    """Let a process run for a share of the time only, as on a slower machine, until the block ends."""
    ended = Event()

    def alternate() -> None:
        while not ended.wait(share * _PERIOD_S):
            os.kill(pid, signal.SIGSTOP)
            ended.wait((1.0 - share) * _PERIOD_S)
            os.kill(pid, signal.SIGCONT)

    thread = Thread(target=alternate, daemon=True)
    if share < 1.0:
        thread.start()
    try:
        yield
    finally:
        ended.set()
        if share < 1.0:
            thread.join()

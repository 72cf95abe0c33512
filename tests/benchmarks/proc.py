"""What the kernel says about a process."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

_PERIOD_S = 0.02  # of stopping and going on
_TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


def cpu_s(pid: int) -> float:
    """User and system time of all its threads so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * _TICK_S


def resident_bytes(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def load() -> float:
    """Processes that ran or waited to run, over the last minute."""
    return os.getloadavg()[0]


@contextmanager
def throttled(pid: int, share: float) -> Iterator[None]:
    """It runs for this share of the time only, as on a slower machine: it is stopped for the rest of each period."""
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

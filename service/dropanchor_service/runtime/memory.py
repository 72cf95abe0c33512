"""Return memory that is no longer used to the system.

The start of the service touches most of LLVM and much of other libraries, and what runs later needs little of them.
The system would take such pages back when it is short of memory; until then they count as resident.

The allocator of glibc returns only the end of each arena. After a burst of messages the process would keep the rest,
and the next burst in another arena would add to it. So there are two arenas, and not eight for each core.
"""

import ctypes
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

PERIOD_S = 60.0
_ARENAS = 2
_M_ARENA_MAX = -8
_MADV_DONTNEED = 4
_MAPPING = re.compile(r"([0-9a-f]+)-([0-9a-f]+) r-(.)p \S+ \S+ \d+ +/")
_CHANGED = re.compile(r"Anonymous: +([0-9]+) kB")


def share_arenas() -> None:
    """Let all threads allocate in two arenas. Call this before there are others. It does nothing without glibc."""
    if (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)) is not None:
        mallopt(_M_ARENA_MAX, _ARENAS)


class HeapTrimmer:
    """Calls malloc_trim(3) now and then; does nothing where the C library lacks it. Not thread-safe."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._trimmed_s = now_s()
        self._malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)

    def trim(self) -> bool:
        """Trim the heap if the last time was PERIOD_S ago. Return whether it did. Other threads run meanwhile."""
        if self._malloc_trim is None or self._now_s() - self._trimmed_s < PERIOD_S:
            return False
        self._trimmed_s = self._now_s()
        self._malloc_trim(ctypes.c_size_t(0))
        return True


def give_back_files() -> None:
    """Let go of pages that hold what is in files: libraries and their constants. Linux only.

    What is needed again comes back from the page cache. A page that this process has changed has no file behind it, so
    mappings with such pages are left alone: the tables of addresses that the loader filled are read-only, too.
    """
    smaps = Path("/proc/self/smaps")
    if not smaps.exists():
        return
    libc = ctypes.CDLL(None)
    for begin, end in _unchanged(smaps.read_text(errors="replace").splitlines()):
        libc.madvise(ctypes.c_void_p(begin), ctypes.c_size_t(end - begin), _MADV_DONTNEED)


def _unchanged(lines: list[str]) -> Iterator[tuple[int, int]]:
    """Yield the private read-only mappings of files that nobody has written to."""
    mapping: tuple[int, int] | None = None
    for line in lines:
        if (found := _MAPPING.match(line)) is not None:
            mapping = int(found[1], 16), int(found[2], 16)
        elif not line[:1].isupper():
            mapping = None  # the head of another mapping
        elif mapping is not None and (changed := _CHANGED.match(line)) is not None and changed[1] == "0":
            yield mapping

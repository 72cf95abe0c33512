"""Heap memory that is no longer used is returned to the system."""

import ctypes
import os
from pathlib import Path

import pytest

from dropanchor_service.runtime.memory import PERIOD_S, HeapTrimmer


def resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="this C library has no malloc_trim")
def test_free_memory_between_used_blocks_is_returned_once_per_period() -> None:
    now_s = [0.0]
    heap = HeapTrimmer(lambda: now_s[0])
    burst = [bytes(10_000) for _ in range(10_000)]
    kept = burst[::100]
    del burst
    before = resident_bytes()
    assert not heap.trim()
    now_s[0] = PERIOD_S
    assert heap.trim()
    assert not heap.trim()
    assert before - resident_bytes() > 50 * 2**20
    assert len(kept) == 100

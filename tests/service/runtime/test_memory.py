"""What was needed for a moment does not stay with the process."""

import ctypes
import os
from pathlib import Path

import pytest

from dropanchor_service.runtime.memory import PERIOD_S, SpareMemory


def resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="this C library has no malloc_trim")
def test_memory_between_what_is_still_used_is_given_back_once_in_a_while() -> None:
    now_s = [0.0]
    spare = SpareMemory(lambda: now_s[0])
    burst = [bytes(10_000) for _ in range(10_000)]
    kept = burst[::100]
    del burst
    before = resident_bytes()
    assert not spare.give_back()
    now_s[0] = PERIOD_S
    assert spare.give_back()
    assert not spare.give_back()
    assert before - resident_bytes() > 50 * 2**20
    assert len(kept) == 100

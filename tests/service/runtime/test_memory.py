"""Heap memory that is no longer used is returned to the system."""

import ctypes
import mmap
import os
from pathlib import Path

import pytest

from dropanchor_service.runtime.memory import PERIOD_S, HeapTrimmer, give_back_files
from support.commands import python


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


THREADS_ALLOCATE = """
import ctypes, sys, threading
from dropanchor_service.runtime.interpreter import prepare_to_serve
prepare_to_serve()
libc, all_there = ctypes.CDLL(None), threading.Barrier(13)
libc.malloc.restype = libc.fdopen.restype = ctypes.c_void_p
def allocate():
    libc.malloc(ctypes.c_size_t(1000))
    all_there.wait()
for _ in range(12):
    threading.Thread(target=allocate).start()
all_there.wait()
output = ctypes.c_void_p(libc.fdopen(1, b"w"))
libc.malloc_info(0, output)
libc.fflush(output)
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_info"), reason="this C library has no malloc_info")
def test_many_threads_share_two_arenas() -> None:
    run = python("-c", THREADS_ALLOCATE)
    assert run.stdout.count("<heap nr=") in (1, 2), run.stderr


def protect(mapped: mmap.mmap, protection: int) -> None:
    address = ctypes.addressof(ctypes.c_char.from_buffer(mapped))
    assert ctypes.CDLL(None).mprotect(ctypes.c_void_p(address), ctypes.c_size_t(len(mapped)), protection) == 0


@pytest.mark.skipif(not Path("/proc/self/smaps").exists(), reason="this system does not list its mappings")
def test_pages_of_files_are_given_back_and_those_that_were_changed_keep_their_content(tmp_path: Path) -> None:
    file, size = tmp_path / "library", 40 * 2**20
    file.write_bytes(b"a" * size)
    with file.open("rb") as opened:
        constants, tables = (
            mmap.mmap(opened.fileno(), size, mmap.MAP_PRIVATE, mmap.PROT_READ | mmap.PROT_WRITE) for _ in range(2)
        )
    tables[5] = ord("b")
    for mapped in (constants, tables):
        protect(mapped, mmap.PROT_READ)
        assert mapped.find(b"c") == -1  # reads all pages
    before = resident_bytes()
    give_back_files()
    assert before - resident_bytes() > 35 * 2**20
    assert resident_bytes() > size
    assert constants[:] == b"a" * size
    assert tables[:7] == b"aaaaaba"

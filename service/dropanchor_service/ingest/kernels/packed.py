"""Read packed payloads, end to end in one buffer of 32-bit words: their forms, and their samples as columns.

The format is that of `dropanchor_schemas.wire`; every valid payload is a whole number of words.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from dropanchor_schemas.kinds import KINDS, SCALARS
from dropanchor_schemas.wire import COUNTS_AT, FLAG_BOOT_CLOCK, FLAG_REPLAY, HEADER, KNOWN_FLAGS, MAX_T_NS, VERSION

FORM = np.dtype(
    [
        ("accepted", "?"),
        ("boot_clock", "?"),
        ("replay", "?"),
        ("numbered", "?"),  # has a sequence and a boot id
        ("sequence", "u4"),
        ("boot_id", "u4"),
        ("t0_ns", "i8"),
        ("kinds", "u1"),  # bit k: it has samples of KINDS[k]
        ("counts", "i8", len(KINDS)),  # of a packed payload
        ("start", "i8"),  # word of the buffer at which its samples begin, -1: not packed
    ]
)

_KINDS: Final = len(KINDS)
_HEADER_WORDS: Final = HEADER.size // 4
_RECORD_WORDS: Final = tuple(kind.record.size // 4 for kind in KINDS)
_COUNT_WORDS: Final = tuple(at // 4 for at in COUNTS_AT)
_COUNT_SHIFTS: Final = tuple(at % 4 * 8 for at in COUNTS_AT)
_ANCHOR_WORDS: Final = tuple(int(kind.has_anchor) for kind in SCALARS)


@njit(nogil=True)
def _count(words: Any, at: int, slot: int) -> int:
    """Return one of the counts of the header that begins at a word."""
    return int(words[at + _COUNT_WORDS[slot]]) >> _COUNT_SHIFTS[slot] & 0xFFFF


@njit(cache=True, nogil=True)
def read_forms(words: Any, starts: Any, sizes: Any, where: Any, forms: Any) -> int:
    """Fill FORM at `where` for every payload. A payload with any error in its form is not accepted.

    words: u4. starts, sizes: words. Returns how many were accepted. The checks are those of `wire.read_header`.
    """
    accepted = 0
    for i in range(len(starts)):
        at = starts[i]
        first = words[at]
        needed, unused = 0, 0
        for k in range(len(_COUNT_WORDS)):
            if k < _KINDS:
                needed += _RECORD_WORDS[k] * _count(words, at, k)
            else:
                unused += _count(words, at, k)
        t0_ns = np.int64(words[at + 4]) | (np.int64(words[at + 5]) << 32)
        flags = (first >> 8) & 0xFF
        form = forms[where[i]]
        form.accepted = (
            first & 0xFF == VERSION
            and flags & ~KNOWN_FLAGS == 0
            and unused == 0
            and sizes[i] == _HEADER_WORDS + needed
            and needed > 0
            and 0 <= t0_ns < MAX_T_NS
        )
        if not form.accepted:
            continue
        accepted += 1
        form.boot_clock = flags & FLAG_BOOT_CLOCK != 0
        form.replay = flags & FLAG_REPLAY != 0
        form.sequence, form.boot_id = words[at + 2], words[at + 3]
        form.numbered = words[at + 3] != 0
        form.t0_ns = t0_ns
        for k in range(_KINDS):
            form.counts[k] = _count(words, at, k)
            form.kinds |= np.uint8((form.counts[k] > 0) << k)
        form.start = at + _HEADER_WORDS
    return accepted


@njit(cache=True, nogil=True)
def read_samples(words: Any, floats: Any, forms: Any, chosen: Any, imu: Any, scalars: Any, starts: Any) -> None:
    """Fill the columns, which are large enough, with the samples of the payloads `chosen`, one after another.

    floats: the same buffer as f4. imu: IMU_SAMPLE. scalars: SCALAR, the columns of all `SCALARS` one behind the other.
    starts: index at which each of them begins.
    """
    filled_imu, filled = 0, starts.copy()
    for i in chosen:
        form = forms[i]
        at = form.start
        if at < 0:
            continue
        for _ in range(form.counts[0]):
            sample = imu[filled_imu]
            sample.message, sample.t_ns = i, form.t0_ns + 1000 * np.int64(words[at])
            for axis in range(3):
                sample.acc[axis] = floats[at + 1 + axis]
                sample.gyro[axis] = floats[at + 4 + axis]
                sample.mag[axis] = floats[at + 7 + axis]
            filled_imu += 1
            at += _RECORD_WORDS[0]
        for k in range(_KINDS - 1):
            anchor_words = _ANCHOR_WORDS[k]
            for _ in range(form.counts[k + 1]):
                scalar = scalars[filled[k]]
                scalar.message, scalar.t_ns = i, form.t0_ns + 1000 * np.int64(words[at])
                scalar.anchor = words[at + 1] if anchor_words else 0
                scalar.value, scalar.std = floats[at + anchor_words + 1], floats[at + anchor_words + 2]
                filled[k] += 1
                at += _RECORD_WORDS[k + 1]

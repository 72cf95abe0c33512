"""Read packed payloads, end to end in one buffer of 32-bit words: their forms, and their samples as columns.

The format is that of `dropanchor_schemas.wire`; every valid payload is a whole number of words.
"""

from typing import Any

import numpy as np
from numba import njit

from dropanchor_schemas.wire import (
    BEARING,
    FLAG_BOOT_CLOCK,
    FLAG_REPLAY,
    HEADER,
    HEADING,
    IMU,
    KNOWN_FLAGS,
    MAX_T_NS,
    RANGE,
    VERSION,
)

FORM = np.dtype(
    [
        ("accepted", "?"),
        ("boot_clock", "?"),
        ("replay", "?"),
        ("numbered", "?"),  # has a sequence and a boot id
        ("sequence", "u4"),
        ("boot_id", "u4"),
        ("t0_ns", "i8"),
        ("counts", "i8", 4),  # imu, range, heading, bearing
        ("start", "i8"),  # word of the buffer at which its samples begin, -1: not packed
    ]
)

_HEADER_WORDS = HEADER.size // 4
_IMU_WORDS, _RANGE_WORDS, _HEADING_WORDS, _BEARING_WORDS = (s.size // 4 for s in (IMU, RANGE, HEADING, BEARING))


@njit(cache=True, nogil=True)
def read_forms(words: Any, starts: Any, sizes: Any, where: Any, forms: Any) -> int:
    """Fill FORM at `where` for every payload. A payload with any error in its form is not accepted.

    words: u4. starts, sizes: words. Returns how many were accepted. The checks are those of `wire.read_header`.
    """
    accepted = 0
    for i in range(len(starts)):
        at = starts[i]
        first = words[at]
        n_imu = np.int64(first >> 16)
        n_range = np.int64(words[at + 1] & 0xFFFF)
        n_heading = np.int64(words[at + 1] >> 16)
        n_bearing = np.int64(words[at + 6] & 0xFFFF)
        needed = n_imu * _IMU_WORDS + n_range * _RANGE_WORDS + n_heading * _HEADING_WORDS + n_bearing * _BEARING_WORDS
        t0_ns = np.int64(words[at + 4]) | (np.int64(words[at + 5]) << 32)
        flags = (first >> 8) & 0xFF
        form = forms[where[i]]
        form.accepted = (
            first & 0xFF == VERSION
            and flags & ~KNOWN_FLAGS == 0
            and words[at + 6] >> 16 == 0
            and words[at + 7] == 0
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
        form.counts[0], form.counts[1], form.counts[2], form.counts[3] = n_imu, n_range, n_heading, n_bearing
        form.start = at + _HEADER_WORDS
    return accepted


@njit(cache=True, nogil=True)
def read_samples(
    words: Any, floats: Any, forms: Any, chosen: Any, imu: Any, ranges: Any, headings: Any, bearings: Any
) -> None:
    """Fill the columns, which are large enough, with the samples of the payloads `chosen`, one after another.

    floats: the same buffer as f4. imu: IMU_SAMPLE. ranges, headings, bearings: SCALAR.
    """
    filled = np.zeros(4, np.int64)
    for i in chosen:
        form = forms[i]
        at = form.start
        if at < 0:
            continue
        for _ in range(form.counts[0]):
            sample = imu[filled[0]]
            sample.message, sample.t_ns = i, form.t0_ns + 1000 * np.int64(words[at])
            for axis in range(3):
                sample.acc[axis] = floats[at + 1 + axis]
                sample.gyro[axis] = floats[at + 4 + axis]
                sample.mag[axis] = floats[at + 7 + axis]
            filled[0] += 1
            at += _IMU_WORDS
        for _ in range(form.counts[1]):
            _read_anchored(words, floats, at, i, form.t0_ns, ranges[filled[1]])
            filled[1] += 1
            at += _RANGE_WORDS
        for _ in range(form.counts[2]):
            heading = headings[filled[2]]
            heading.message, heading.t_ns = i, form.t0_ns + 1000 * np.int64(words[at])
            heading.anchor, heading.value, heading.std = 0, floats[at + 1], floats[at + 2]
            filled[2] += 1
            at += _HEADING_WORDS
        for _ in range(form.counts[3]):
            _read_anchored(words, floats, at, i, form.t0_ns, bearings[filled[3]])
            filled[3] += 1
            at += _BEARING_WORDS


@njit(nogil=True)
def _read_anchored(words: Any, floats: Any, at: int, message: int, t0_ns: int, scalar: Any) -> None:
    scalar.message, scalar.t_ns = message, t0_ns + 1000 * np.int64(words[at])
    scalar.anchor, scalar.value, scalar.std = words[at + 1], floats[at + 2], floats[at + 3]

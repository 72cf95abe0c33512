"""The rules of times: bring the rows of a table in order, or say where its clock goes wrong.

Every reader of recordings uses them, those of foreign data too.
"""

import itertools
from collections.abc import Iterable, Sequence
from statistics import median_low
from typing import NamedTuple

from dropanchor_tag_client.recording.recording import RecordingError
from dropanchor_tag_client.recording.table import Table
from dropanchor_tag_client.recording.units import DW1000, DW1000_TICKS, interval_of

MAX_DISORDER_S = 1.0  # between the sensors of one file
MAX_GLITCHES = 3  # single rows with a wrong time
LONG_GAP_S = 86_400.0
FAR_S = 30 * 86_400.0  # from most other rows: a device whose clock is not set sends 1970, or nonsense
MIN_SHARED = 0.05  # share of the rows of a table


class Counter(NamedTuple):
    name: str
    period_s: float


COUNTERS = (
    Counter("2^32 microseconds", 2**32 / 1e6),
    Counter("2^32 milliseconds", 2**32 / 1e3),
    Counter("2^32 nanoseconds", 2**32 / 1e9),
    Counter("2^16 milliseconds", 2**16 / 1e3),
    Counter("2^40 ticks of the DW1000", DW1000_TICKS / DW1000.per_second),
)


class Ordered(NamedTuple):
    """rows: those that are used, in order of time. notes: sentences on what was wrong with the times."""

    rows: list[int]
    notes: list[str]


def put_in_order(table: Table) -> list[str]:
    """Sort the rows of the table by the rules of `in_order`. Return its sentences. Raises RecordingError."""
    rows, notes = in_order(table)
    table.take(rows)
    return notes


def in_order(table: Table) -> Ordered:
    """Return the rows by their times in s. Continues a counter that wraps, in the times of the table.

    Rows far from most others and up to MAX_GLITCHES with a wrong time are left out. Raises RecordingError where the
    time goes back by more than MAX_DISORDER_S otherwise. Ranges are judged for each anchor.
    """
    notes: list[str] = []
    for series in _series(table, range(len(table))):
        notes += _unwrap(table, series, [table.t[row] for row in series])
    near = _near(table, notes)
    kept: list[int] = []
    for series in _series(table, near):
        kept += _in_order(table, series, notes)
    notes += _shared(table, kept)
    return Ordered(sorted(sorted(kept), key=table.t.__getitem__), list(dict.fromkeys(notes)))


def _near(table: Table, notes: list[str]) -> list[int]:
    """Return the rows near most others. Adds a sentence on the rest."""
    middle = median_low(table.t) if len(table) else 0.0
    is_near = [abs(t - middle) <= FAR_S for t in table.t]
    if not all(is_near):
        place = table.rows.place(is_near.index(False))
        notes.append(f"{place}: a time more than 30 days from most others: left out{_more(is_near.count(False) - 1)}")
    return [row for row, near in enumerate(is_near) if near]


def _series(table: Table, rows: Iterable[int]) -> list[list[int]]:
    """Return the rows of each anchor, or all rows."""
    by_text: dict[str, list[int]] = {}
    for row in rows:
        by_text.setdefault(table.texts[row] if table.texts else "", []).append(row)
    return list(by_text.values())


def _in_order(table: Table, rows: list[int], notes: list[str]) -> list[int]:
    """Return the rows that are used. Adds sentences to `notes`."""
    t = [table.t[row] for row in rows]
    if _is_sorted(t):
        notes += _jump_ahead(table, rows, t)
        return rows
    notes += _unwrap(table, rows, t)  # again, now without what is far
    glitches = _glitches(t)
    if glitches:
        first = table.rows.place(rows[min(glitches)])
        rows = [row for i, row in enumerate(rows) if i not in glitches]
        t = [value for i, value in enumerate(t) if i not in glitches]
        notes.append(f"{first}: a time far from those around it: left out{_more(len(glitches) - 1)}")
    worst = 0.0
    newest = t[0]
    for row, value in zip(rows, t, strict=True):
        if newest - value > MAX_DISORDER_S:
            raise RecordingError(goes_back(f"{table.path} {table.rows.unit} {table.rows.numbers[row]}", newest - value))
        worst, newest = max(worst, newest - value), max(newest, value)
    if worst:
        notes.append(f"{table.rows.file}: rows were up to {worst:.3g} s out of order: sorted by time")
    return rows


def _more(count: int) -> str:
    return f", and {count} more like it" if count else ""


def _is_sorted(t: Sequence[float]) -> bool:
    return all(a <= b for a, b in itertools.pairwise(t))


def goes_back(place: str, by_s: float) -> str:
    """Return what is wrong with a time before the one that stands before it, and what to do."""
    return (
        f"{place}: the time goes back by {by_s:.1f} s. A recording needs one clock that runs forward in all its files: "
        f"split it there into two recordings, or add {by_s:.1f} s to the times from there on"
    )


def _unwrap(table: Table, rows: list[int], t: list[float]) -> list[str]:
    """Continue the times behind each wrap, in `t` and in the table, if a counter explains all steps back."""
    back = [i for i in range(1, len(t)) if t[i - 1] - t[i] > MAX_DISORDER_S]
    if not back:
        return []
    slack_s = 20.0 * (interval_of(t) or 0.0)
    for name, period_s in COUNTERS:
        steps = [t[i] + period_s - t[i - 1] for i in back]
        if max(t) - min(t) <= period_s and all(0.0 <= step <= min(slack_s, period_s / 4) for step in steps):
            place = table.rows.place(rows[back[0]])
            _continue(table, rows, t, back, period_s)
            return [f"{place}: the counter behind the times wraps at {name}: continued{_more(len(back) - 1)}"]
    return []


def _continue(table: Table, rows: list[int], t: list[float], back: list[int], period_s: float) -> None:
    for begin, end, turns in zip(back, [*back[1:], len(t)], range(1, len(back) + 1), strict=True):
        for i in range(begin, end):
            t[i] += turns * period_s
            table.t[rows[i]] = t[i]


def _glitches(t: Sequence[float]) -> set[int]:
    """Return single rows without which the time runs forward, at most MAX_GLITCHES."""
    found: set[int] = set()
    for i in range(1, len(t)):
        if i - 1 in found or t[i - 1] - t[i] <= MAX_DISORDER_S:
            continue
        if i + 1 == len(t) or t[i + 1] >= t[i - 1] - MAX_DISORDER_S:
            found.add(i)
        elif i == 1 or t[i] >= t[i - 2] - MAX_DISORDER_S:
            found.add(i - 1)
    return found if len(found) <= MAX_GLITCHES else set()


def _jump_ahead(table: Table, rows: list[int], t: Sequence[float]) -> list[str]:
    """Name the first jump ahead by days."""
    for i in range(1, len(t)):
        days = (t[i] - t[i - 1]) / LONG_GAP_S
        if days > 1.0:
            return [f"{table.rows.place(rows[i])}: the time jumps ahead by {days:.0f} days: was the clock set?"]
    return []


def _shared(table: Table, rows: list[int]) -> list[str]:
    """Say how many rows share their time with another one of the same anchor."""
    seen: dict[tuple[str, float], int] = {}
    keys = [(table.texts[row] if table.texts else "", table.t[row]) for row in rows]
    for key in keys:
        seen[key] = seen.get(key, 0) + 1
    shared = sum(count for count in seen.values() if count > 1)
    if shared < max(2.0, MIN_SHARED * len(rows)):
        return []
    return [
        f"{table.rows.file}: several samples have the same time: {shared:,} of {len(rows):,} {table.file.holds} share "
        "their time with another; the times need fractions of a second"
    ]

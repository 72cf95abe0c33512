"""JSON of many like objects: forms with holes, filled with numbers and with texts that are JSON already.

A hole is one byte below a space, which no JSON holds. Indices are unsigned: numba would ask of every other one whether
it counts from the end. Every helper is inlined: a call costs as much as the number that it is for.
"""

from typing import Any, Final

import numpy as np
from numba import njit

NUMBER: Final = 1  # the next of the row's numbers
INTEGER: Final = 2  # its integer
TEXT: Final = 3  # the next of all texts
PASSED_OVER: Final = 4  # the next of the row's numbers, of which nothing is to be seen here
END: Final = 5  # of the form

BEYOND: Final = 9e18  # numbers from here on are null, as NaN is: their digits do not fit into 64 bits
LONGEST: Final = 30  # characters of a number: a sign, 19 digits, a point and 9 decimals

_POWERS: Final = 10.0 ** np.arange(10)
_ONE: Final = np.uint64(1)
_TEN: Final = np.uint64(10)
_ZERO: Final = np.uint64(ord("0"))


@njit(cache=True, nogil=True)
def fill(
    forms: Any,
    begins: Any,
    holes: Any,
    first_hole: Any,
    form_of: Any,
    numbers: Any,
    decimals: Any,
    integers: Any,
    texts: Any,
    text_ends: Any,
    filled: Any,
    ends: Any,
) -> None:
    """Into `filled` (bytes): of every row its form, with the holes filled; into `ends`: where each of them ends.

    forms: bytes; begins: where each begins; holes: where they are, with `first_hole` of each form. numbers: one row per
    row, rounded to `decimals` of each column; integers: one per row. texts: bytes; text_ends: where each ends."""
    place = text = np.uint64(0)
    which = 0
    for row in range(len(form_of)):
        at, next_hole = np.uint64(begins[form_of[row]]), first_hole[form_of[row]]
        column, hole = 0, 0
        while hole != END:
            place, at = _copied(forms, at, np.uint64(holes[next_hole]), filled, place)
            hole = forms[at]
            at += _ONE
            next_hole += 1
            if hole == NUMBER:
                place = _rounded(numbers[row, column], decimals[column], filled, place)
                column += 1
            elif hole == PASSED_OVER:
                column += 1
            elif hole == INTEGER:
                place = _integer(np.uint64(integers[row]), filled, place)
            elif hole == TEXT:
                place, text = _copied(texts, text, np.uint64(text_ends[which]), filled, place)
                which += 1
        ends[row] = place


@njit(nogil=True, inline="always")
def _copied(source: Any, begin: Any, end: Any, filled: Any, place: Any) -> tuple[Any, Any]:
    """Where both go on."""
    while begin < end:
        filled[place] = source[begin]
        place += _ONE
        begin += _ONE
    return place, begin


@njit(nogil=True, inline="always")
def _rounded(value: float, decimals: int, filled: Any, place: Any) -> Any:
    """Where it goes on. No more decimals than are needed, but one."""
    size = abs(value)
    if not size < BEYOND:
        for byte in b"null":
            filled[place] = byte
            place += _ONE
        return place
    whole = np.int64(size)
    parts = np.int64((size - whole) * _POWERS[decimals] + 0.5)
    if parts >= _POWERS[decimals]:
        whole, parts = whole + 1, np.int64(0)
    fraction = np.uint64(parts)
    if value < 0.0 and whole + parts > 0:
        filled[place] = ord("-")
        place += _ONE
    while decimals > 1 and fraction % _TEN == 0:
        fraction //= _TEN
        decimals -= 1
    place = _integer(np.uint64(whole), filled, place)
    filled[place] = ord(".")
    return _digits(fraction, decimals, filled, place + _ONE)


@njit(nogil=True, inline="always")
def _integer(number: Any, filled: Any, place: Any) -> Any:
    """Where it goes on."""
    length, beyond = 1, _TEN
    while number >= beyond and length < 19:
        beyond *= _TEN
        length += 1
    return _digits(number, length, filled, place)


@njit(nogil=True, inline="always")
def _digits(number: Any, length: int, filled: Any, place: Any) -> Any:
    """Where it goes on."""
    end = at = place + np.uint64(length)
    for _ in range(length):
        at -= _ONE
        rest = number // _TEN
        filled[at] = _ZERO + number - rest * _TEN
        number = rest
    return end

"""Write the JSON of many like objects: fill forms with numbers and with texts.

A form is JSON with placeholders, and the texts are JSON already. A placeholder is one byte below a space, which JSON
cannot contain. Indices are unsigned, because numba checks signed ones for counting from the end. All helpers are
inlined, because a call costs as much as writing a number.
"""

from typing import Any, Final

import numpy as np
from numba import njit

NUMBER: Final = 1  # the next of the row's numbers
INTEGER: Final = 2  # its integer
TEXT: Final = 3  # the next of all texts
SKIPPED: Final = 4  # the next of the row's numbers is not written
END: Final = 5  # of the form

BEYOND: Final = 9e18  # larger numbers become null, as NaN does: their digits do not fit into 64 bits
LONGEST: Final = 30  # characters of the longest number: a sign, 19 digits, a point and 9 decimals

_POWERS: Final = 10.0 ** np.arange(10)
_ONE: Final = np.uint64(1)
_TEN: Final = np.uint64(10)
_ZERO: Final = np.uint64(ord("0"))


@njit(cache=True, nogil=True)
def fill(
    forms: Any,
    begins: Any,
    placeholders: Any,
    first_placeholder: Any,
    form_of: Any,
    numbers: Any,
    decimals: Any,
    integers: Any,
    texts: Any,
    text_ends: Any,
    filled: Any,
    ends: Any,
) -> None:
    """Fill `filled` (bytes) with the form of every row, with its placeholders filled, and `ends` with the end of each.

    forms: bytes. begins: offset of each form. placeholders: offsets of all placeholders. first_placeholder: index of
    the first one of each form. numbers: one row per row of the output, rounded to the `decimals` of each column.
    integers: one per row. texts: bytes. text_ends: offset of the end of each text.
    """
    place = text = np.uint64(0)
    which = 0
    for row in range(len(form_of)):
        at, next_placeholder = np.uint64(begins[form_of[row]]), first_placeholder[form_of[row]]
        column, kind = 0, 0
        while kind != END:
            place, at = _copied(forms, at, np.uint64(placeholders[next_placeholder]), filled, place)
            kind = forms[at]
            at += _ONE
            next_placeholder += 1
            if kind == NUMBER:
                place = _rounded(numbers[row, column], decimals[column], filled, place)
                column += 1
            elif kind == SKIPPED:
                column += 1
            elif kind == INTEGER:
                place = _integer(np.uint64(integers[row]), filled, place)
            elif kind == TEXT:
                place, text = _copied(texts, text, np.uint64(text_ends[which]), filled, place)
                which += 1
        ends[row] = place


@njit(nogil=True, inline="always")
def _copied(source: Any, begin: Any, end: Any, filled: Any, place: Any) -> tuple[Any, Any]:
    """Copy bytes. Return the offsets of the next bytes of `filled` and of `source`."""
    while begin < end:
        filled[place] = source[begin]
        place += _ONE
        begin += _ONE
    return place, begin


@njit(nogil=True, inline="always")
def _rounded(value: float, decimals: int, filled: Any, place: Any) -> Any:
    """Write a rounded number with at least one decimal and no trailing zeros. Return the offset of the next byte."""
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
    """Write an integer. Return the offset of the next byte."""
    length, beyond = 1, _TEN
    while number >= beyond and length < 19:
        beyond *= _TEN
        length += 1
    return _digits(number, length, filled, place)


@njit(nogil=True, inline="always")
def _digits(number: Any, length: int, filled: Any, place: Any) -> Any:
    """Write a number with this many digits. Return the offset of the next byte."""
    end = at = place + np.uint64(length)
    for _ in range(length):
        at -= _ONE
        rest = number // _TEN
        filled[at] = _ZERO + number - rest * _TEN
        number = rest
    return end

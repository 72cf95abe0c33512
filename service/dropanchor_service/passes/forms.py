"""JSON of many like objects: forms with holes, filled with numbers and texts that are JSON already.

A hole is one byte below a space, which no JSON holds. Indices are unsigned: numba would ask of every other one whether
it counts from the end.
"""

from typing import Any, Final

import numpy as np
from numba import njit

NUMBER: Final = 1  # the next of the numbers
INTEGER: Final = 2  # the next of the integers
TEXT: Final = 3  # the next of the texts
PASSED_OVER: Final = 4  # the next of the numbers, of which nothing is to be seen here
END: Final = 5  # of the form

_ONE: Final = np.uint64(1)
_COMMA: Final = np.uint8(ord(","))
_OPENED: Final = np.uint8(ord("["))
_CLOSED: Final = np.uint8(ord("]"))


@njit(cache=True, nogil=True)
def fill(
    forms: Any,
    begins: Any,
    holes: Any,
    first_hole: Any,
    form_of: Any,
    numbers: Any,
    integers: Any,
    texts: Any,
    text_ends: Any,
    filled: Any,
    ends: Any,
) -> None:
    """Into `filled` (bytes): of every row its form, with the holes filled; into `ends`: where each of them ends.

    forms: bytes; begins: where each begins; holes: where they are, with `first_hole` of each form. numbers, integers:
    bytes of JSON arrays, of arrays or not. texts: bytes; text_ends: where each ends."""
    place = number = integer = text = np.uint64(0)
    which = 0
    for row in range(len(form_of)):
        at, k = np.uint64(begins[form_of[row]]), first_hole[form_of[row]]
        hole = 0
        while hole != END:
            end = np.uint64(holes[k])
            k += 1
            while at < end:
                filled[place] = forms[at]
                place += _ONE
                at += _ONE
            hole = forms[at]
            at += _ONE
            if hole == NUMBER:
                number, place = _copied(numbers, number, filled, place)
            elif hole == INTEGER:
                integer, place = _copied(integers, integer, filled, place)
            elif hole == TEXT:
                end = np.uint64(text_ends[which])
                which += 1
                while text < end:
                    filled[place] = texts[text]
                    place += _ONE
                    text += _ONE
            elif hole == PASSED_OVER:
                number, _ = _copied(numbers, number, filled, place)
        ends[row] = place


@njit(nogil=True)
def _copied(source: Any, at: Any, filled: Any, place: Any) -> tuple[Any, Any]:
    """The element of `source` that begins at or after `at` is put at `place`; where both go on."""
    byte = source[at]
    while byte in (_OPENED, _CLOSED, _COMMA):
        at += _ONE
        byte = source[at]
    while byte != _CLOSED and byte != _COMMA:
        filled[place] = byte
        place += _ONE
        at += _ONE
        byte = source[at]
    return at, place

"""JSON of many like objects at once: no object of Python for each of them, nor for a number in them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import orjson

from dropanchor_service.answers.kernels import json_numbers as holes
from dropanchor_service.answers.kernels.json_numbers import fill
from dropanchor_service.estimation.columns import Array

NUMBER = orjson.Fragment(bytes([holes.NUMBER]))
INTEGER = orjson.Fragment(bytes([holes.INTEGER]))
TEXT = orjson.Fragment(bytes([holes.TEXT]))
QUOTED = orjson.Fragment(b'"%c"' % holes.TEXT)
"""What stands in a form where every row has something else."""


def nothing_of(numbers: int) -> orjson.Fragment:
    """In place of so many numbers of the row: null."""
    return orjson.Fragment(b"null" + bytes([holes.PASSED_OVER]) * numbers)


@dataclass(frozen=True)
class Filled:
    """text: the objects, with a comma before each of them; ends: where each ends."""

    text: memoryview
    ends: Array

    @property
    def all(self) -> memoryview:
        return self.text[1:]

    @property
    def each(self) -> list[bytes]:
        ends = self.ends.tolist()
        return [bytes(self.text[begin + 1 : end]) for begin, end in zip([0, *ends], ends, strict=False)]


def filled(
    forms: Sequence[bytes],
    form_of: Array,
    numbers: Array,
    decimals: Array,
    integers: Array | None = None,
    texts: Sequence[bytes] = (),
) -> Filled:
    """The form of each row (`form_of`: which one), with its holes filled in the order in which they stand.

    numbers: floats, per row as many as its form shows or leaves out, rounded to `decimals` of each column; NaN is null.
    integers: at most one per row. texts: all rows' in turn.
    """
    closed = [b",%b%c" % (form, holes.END) for form in forms]
    lengths = np.array([len(form) for form in closed])
    begins = np.cumsum(lengths) - lengths
    form_bytes, text_bytes = _bytes(b"".join(closed)), _bytes(b"".join(texts))
    text_ends = np.cumsum(np.fromiter(map(len, texts), np.int64, len(texts)))
    hole_at = np.flatnonzero(form_bytes < ord(" "))
    first_hole = np.searchsorted(hole_at, begins)
    whole = np.zeros(len(form_of), np.int64) if integers is None else np.ascontiguousarray(integers)
    most = int(lengths[form_of].sum()) + (numbers.size + len(whole)) * holes.LONGEST + len(text_bytes)
    out, ends = np.empty(most, np.uint8), np.empty(len(form_of), np.int64)
    fill(form_bytes, begins, hole_at, first_hole, form_of, numbers, decimals, whole, text_bytes, text_ends, out, ends)
    return Filled(out[: ends[-1] if len(ends) else 0].data, ends)


def _bytes(text: bytes) -> Array:
    return np.frombuffer(text, np.uint8)

"""Write the JSON of many like objects at once, without a Python object for each of them or for its numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import orjson

from dropanchor_service.answers.kernels import json_numbers
from dropanchor_service.answers.kernels.json_numbers import fill
from dropanchor_service.estimation.columns import Array

NUMBER = orjson.Fragment(bytes([json_numbers.NUMBER]))
INTEGER = orjson.Fragment(bytes([json_numbers.INTEGER]))
TEXT = orjson.Fragment(bytes([json_numbers.TEXT]))
QUOTED = orjson.Fragment(b'"%c"' % json_numbers.TEXT)
"""Placeholders in a form for the values of a row."""


def null_for(numbers: int) -> orjson.Fragment:
    """Return a placeholder that writes null and skips this many numbers of the row."""
    return orjson.Fragment(b"null" + bytes([json_numbers.SKIPPED]) * numbers)


@dataclass(frozen=True)
class Filled:
    """The JSON of all objects. text: the objects, each with a comma before it. ends: offset of the end of each."""

    text: memoryview
    ends: Array

    @property
    def all(self) -> memoryview:
        """The objects, separated by commas."""
        return self.text[1:]

    @property
    def each(self) -> list[bytes]:
        """Each object by itself."""
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
    """Return the form of each row, with its placeholders filled in their order.

    form_of: index of the form of each row. numbers: floats, one column per number that a form writes or skips, rounded
    to the `decimals` of its column; NaN becomes null. integers: one per row. texts: of all rows, one after another.
    """
    closed = [b",%b%c" % (form, json_numbers.END) for form in forms]
    lengths = np.array([len(form) for form in closed])
    begins = np.cumsum(lengths) - lengths
    form_bytes, text_bytes = _bytes(b"".join(closed)), _bytes(b"".join(texts))
    text_ends = np.cumsum(np.fromiter(map(len, texts), np.int64, len(texts)))
    placeholders = np.flatnonzero(form_bytes < ord(" "))
    first_placeholder = np.searchsorted(placeholders, begins)
    row_integers = np.zeros(len(form_of), np.int64) if integers is None else np.ascontiguousarray(integers)
    capacity = int(lengths[form_of].sum()) + (numbers.size + len(row_integers)) * json_numbers.LONGEST + len(text_bytes)
    out, ends = np.empty(capacity, np.uint8), np.empty(len(form_of), np.int64)
    fill(
        *(form_bytes, begins, placeholders, first_placeholder, form_of),
        *(numbers, decimals, row_integers, text_bytes, text_ends),
        *(out, ends),
    )
    return Filled(out[: ends[-1] if len(ends) else 0].data, ends)


def _bytes(text: bytes) -> Array:
    return np.frombuffer(text, np.uint8)

"""Take, put and copy structured records as opaque bytes. NumPy copies them field by field, 20 times slower."""

from collections.abc import Collection
from functools import cache
from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import Array


def take(records: Array, index: Any) -> Array:
    """Return a copy of `records[index]`."""
    taken: Array = _opaque(records)[index].view(records.dtype)
    return taken


def copied(records: Array) -> Array:
    """Return a copy of the records."""
    copy: Array = _opaque(records).copy().view(records.dtype)
    return copy


def put(records: Array, index: Any, values: Array) -> None:
    """Assign `records[index] = values`, both of one dtype. With repeated indices the last value wins."""
    _opaque(records)[index] = _opaque(values)


def enlarged(records: Array, length: int) -> Array:
    """Return the records padded with zeros to `length`. The zeros take no memory until they are written."""
    grown = np.zeros((length, *records.shape[1:]), records.dtype)
    _opaque(grown)[: len(records)] = _opaque(records)
    return grown


def narrow(dtype: "np.dtype[np.void]", wide: Collection[str]) -> "np.dtype[np.void]":
    """Return the dtype with float32 (seven digits) in place of float64, but for the fields in `wide`."""
    fields = []
    for name in dtype.names or ():
        base, shape = dtype[name].base, dtype[name].shape
        fields.append((name, np.dtype("f4") if base == np.float64 and name not in wide else base, shape))
    return np.dtype(fields)


def _opaque(records: Array) -> Array:
    return records.view(_bytes(records.dtype.itemsize))


@cache
def _bytes(count: int) -> "np.dtype[np.void]":
    return np.dtype((np.void, count))

"""Kernels without the compiler, with NUMBA_DISABLE_JIT=1: a breakpoint stops in them, and coverage sees them.

They take about thirty times as long.
"""

import functools
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def in_plain_python(function: Kernel) -> Kernel:
    """Return a kernel in Python: the fields of records are attributes, and a division by zero gives inf or NaN."""

    @functools.wraps(function)
    def called(*given: Any, **named: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*map(_as_record, given), **{name: _as_record(value) for name, value in named.items()})

    return called  # type: ignore[return-value]


class _Record(np.record):  # type: ignore[misc]  # said to be final, and is not
    """A record whose field hides a method of the same name, such as `std`."""

    def __getattribute__(self, name: str) -> Any:
        fields = np.void.__getattribute__(self, "dtype").fields
        return _as_record(self[name]) if fields and name in fields else np.void.__getattribute__(self, name)


def _as_record(value: Any) -> Any:
    """Return a view of a structured array or scalar whose fields are attributes, anything else as it is."""
    if isinstance(value, np.ndarray | np.void) and value.dtype.names and value.dtype.type is not _Record:
        return value.view(np.dtype((_Record, value.dtype)))
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*map(_as_record, value))
    return value

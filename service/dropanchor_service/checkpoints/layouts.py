"""Which layouts of checkpoints there are, which of them this version reads, and the columns of each.

The name of a layout is its number and a digest of its columns. A higher number is a later layout.
"""

import hashlib
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from dropanchor_schemas.sentences import say

VERSION = 10
"""Number of the layout that this version writes. Raise it when a column of the state changes, in its name, its type or
its meaning: `migrations.py` says what else to do."""
READ_BEFORE = 2
"""How many layouts before its own a version reads."""

_NUMBERED = re.compile(r"([1-9]\d*)-[0-9a-f]{16}")

DTypes = Mapping[str, np.dtype[Any]]


def name_of(dtypes: DTypes) -> str:
    """Return the name of the present layout, whose arrays have these dtypes."""
    text = repr(sorted((name, str(np.lib.format.dtype_to_descr(dtype))) for name, dtype in dtypes.items()))
    return f"{VERSION}-{hashlib.blake2b(text.encode(), digest_size=8).hexdigest()}"


def version_of(layout: str) -> int | None:
    """Return the number of a layout, None if this version does not know its name."""
    numbered = _NUMBERED.fullmatch(layout)
    return None if numbered is None else int(numbered[1])


def why_unreadable(layout: str, own: str) -> str | None:
    """Return why a version whose layout is `own` does not read another one, as the end of a sentence; None if it does.

    The sentence begins with what has the layout: "its layout is".
    """
    if layout == own:
        return None
    version, oldest = version_of(layout), VERSION - READ_BEFORE
    if version is not None and oldest <= version < VERSION:
        return None
    if version is not None and version > VERSION:
        return say(
            "layout_later",
            "{theirs}, which a later version wrote: install that version. This one uses {ours}",
            theirs=layout,
            ours=own,
        )
    if version is not None and version < oldest:
        return say(
            "layout_too_early",
            "{theirs}, but this version uses {ours} and reads none before {oldest}",
            theirs=layout,
            ours=own,
            oldest=oldest,
        )
    return say("layout_differs", "{theirs}, but this version uses {ours}", theirs=layout, ours=own)


def may_be_read(layout: str) -> bool:
    """Return whether the number of a layout is one that this version reads. Its columns may still be others."""
    version = version_of(layout)
    return version is not None and VERSION - READ_BEFORE <= version <= VERSION


def described(dtypes: DTypes) -> dict[str, Any]:
    """Return the columns of arrays as values that JSON can hold."""
    return {name: _described(dtype) for name, dtype in dtypes.items()}


@cache
def _described(dtype: np.dtype[Any]) -> Any:
    return np.lib.format.dtype_to_descr(dtype)


def dtypes_of(description: Mapping[str, Any]) -> DTypes:
    """Return what `described` was given."""
    return {name: np.lib.format.descr_to_dtype(_as_written(columns)) for name, columns in description.items()}


def _as_written(columns: Any) -> Any:
    """Return a description with the tuples that NumPy wants and JSON does not have."""
    if isinstance(columns, str):
        return columns
    return [(name, _as_written(kind), *(tuple(shape) for shape in shapes)) for name, kind, *shapes in columns]

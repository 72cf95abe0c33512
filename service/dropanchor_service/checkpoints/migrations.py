"""Go on from a checkpoint of one of the two layouts before the present one.

Columns are known by their names. One that did not change is copied, a new one gets what it has in a tag without
samples, and one that is gone is dropped. Where the type or the meaning of a column changes, write a function that
turns a snapshot of one layout into one of the next:

1. before the change, write the golden file of the present layout (`tests/support/golden_checkpoint.py`);
2. raise `layouts.VERSION`, and drop what belongs to layouts that are no longer read;
3. enter the function in `STEPS`. Without one, a checkpoint is refused if the type of a column has changed, and used as
   it is if only the meaning has.
"""

from collections.abc import Callable, Mapping

import numpy as np

from dropanchor_service.checkpoints.format import CheckpointError, Snapshot
from dropanchor_service.checkpoints.layouts import VERSION, DTypes
from dropanchor_service.estimation.columns import Array, default_settings

Fresh = Callable[[Array], Mapping[str, Array]]
"""Takes TAG_SETTINGS of all rows, and returns the arrays of the engine as they are before the first sample."""
Steps = Mapping[int, Callable[[Snapshot], Snapshot]]

SETTINGS = "engine.settings"
STEPS: Steps = {}


def migrated(found: Snapshot, version: int, dtypes: DTypes, fresh: Fresh, steps: Steps = STEPS) -> Snapshot:
    """Return a snapshot of an earlier layout as one of the present layout, which has these dtypes.

    Raises CheckpointError.
    """
    for number in range(version, VERSION):
        if number in steps:
            found = steps[number](found)
    settings = found.arrays.get(SETTINGS)
    if settings is None:
        raise CheckpointError(f"it has no {SETTINGS}")
    like = np.full(len(settings), default_settings())
    copy_columns(settings, like, SETTINGS)
    known = {SETTINGS: like, **fresh(like)}
    return Snapshot({name: _array(name, found, dtype, known) for name, dtype in dtypes.items()}, found.document)


def as_they_are(found: Snapshot, dtypes: DTypes) -> Snapshot:
    """Return a snapshot of the present layout with its own dtypes: those read from a file lack the alignment."""
    return Snapshot({name: array.view(dtypes[name]) for name, array in found.arrays.items()}, found.document)


def _array(name: str, found: Snapshot, dtype: np.dtype[np.void], known: Mapping[str, Array]) -> Array:
    """Return an array of the present layout."""
    before, like = found.arrays.get(name), known.get(name)
    if before is None:
        return np.zeros(0, dtype) if like is None else like
    if before.dtype == dtype:
        return before.view(dtype)
    made = like if like is not None and len(like) == len(before) else _unknown(len(before), dtype)
    copy_columns(before, made, name)
    return made


def _unknown(length: int, dtype: np.dtype[np.void]) -> Array:
    """Return records of which nothing is known: numbers are NaN, counts and codes 0."""
    records = np.zeros(length, dtype)
    for name in dtype.names or ():
        if records[name].dtype.kind == "f":
            records[name] = np.nan
    return records


def copy_columns(before: Array, after: Array, name: str) -> None:
    """Copy the columns that both have. name: of the array, for people. Raises CheckpointError if one has changed."""
    if before.dtype.names is None or after.dtype.names is None:
        if before.dtype != after.dtype or before.shape != after.shape:
            raise CheckpointError(f"{name} was {_type(before)} and is {_type(after)} in this version")
        after[...] = before
        return
    for column in after.dtype.names:
        if column in before.dtype.names:
            copy_columns(before[column], after[column], f"{name}.{column}")


def _type(column: Array) -> str:
    kind = "a record" if column.dtype.names else str(column.dtype)
    return kind if column.ndim == 1 else f"{kind} {column.shape[1:]}"

"""What changed since a checkpoint, as blocks of bytes: most tags stand, and most of what is kept of one stays.

It is packed and sealed like a checkpoint. The line of JSON has the shapes of the arrays, how many blocks of each have
changed, and the document if that is another one. Then come, for each array, the places of these blocks, the blocks, and
what is behind the last whole one.
"""

from io import BytesIO

import numpy as np

from dropanchor_service.checkpoints.format import Snapshot, bytes_of, sealed, unsealed
from dropanchor_service.estimation.columns import Array

BLOCK = 64  # bytes, which are eight numbers: smaller ones save nothing after they are packed
_PLACE = np.dtype("<u4")


def changes(before: Snapshot, after: Snapshot) -> list[bytes]:
    """Return what makes one snapshot of another, in parts. Both have the same arrays."""
    changed = {name: _changed(before.arrays[name], array) for name, array in after.arrays.items()}
    header = {
        "shapes": {name: array.shape for name, array in after.arrays.items()},
        "blocks": {name: len(places) for name, places in changed.items()},
        "document": None if after.document == before.document else after.document,
    }
    parts: list[Array] = []
    for name, places in changed.items():
        blocks, rest = _blocks(after.arrays[name])
        parts += [places, blocks[places], rest]
    return sealed(header, parts)


def applied(before: Snapshot, whole: bytes) -> Snapshot:
    """Return the snapshot that `changes` was given as the later one. Raises CheckpointError if `whole` is damaged."""
    header, content = unsealed(whole)
    stream, arrays = BytesIO(content), {}
    for name, shape in header["shapes"].items():
        array = arrays[name] = np.empty(shape, before.arrays[name].dtype)
        new, old = bytes_of(array), bytes_of(before.arrays[name])
        new[: len(old)] = old[: len(new)]
        blocks, rest = _blocks(array)
        places = np.frombuffer(stream.read(header["blocks"][name] * _PLACE.itemsize), _PLACE)
        blocks[places] = np.frombuffer(stream.read(len(places) * BLOCK), blocks.dtype).reshape(-1, blocks.shape[1])
        rest[:] = np.frombuffer(stream.read(len(rest)), np.uint8)
    return Snapshot(arrays, before.document if header["document"] is None else header["document"])


def _changed(before: Array, after: Array) -> Array:
    """Return the places of the whole blocks that are others, or were not there before."""
    (old, _), (new, _) = _blocks(before), _blocks(after)
    differs = np.ones(len(new), bool)
    both = min(len(old), len(new))
    np.any(old[:both] != new[:both], axis=1, out=differs[:both])
    return np.flatnonzero(differs).astype(_PLACE)


def _blocks(array: Array) -> tuple[Array, Array]:
    """Return the whole blocks of an array as rows of integers, and the bytes behind them, all in its memory."""
    whole = bytes_of(array)
    end = len(whole) // BLOCK * BLOCK
    return whole[:end].view(np.uint64).reshape(-1, BLOCK // 8), whole[end:]

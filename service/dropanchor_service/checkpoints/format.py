"""The bytes of a checkpoint, and what a place for checkpoints offers. A checksum detects damage.

A checkpoint is one line of JSON (layout, columns and shapes of the arrays, and the document), then the arrays,
little-endian as in memory, then the BLAKE2b digest of everything before it.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import orjson

from dropanchor_service.checkpoints.layouts import DTypes, described, dtypes_of
from dropanchor_service.estimation.columns import Array

_DIGEST_BYTES = 32


class CheckpointError(Exception):
    """A checkpoint cannot be used or written; the message says why."""


class UnreadableLayoutError(CheckpointError):
    """A checkpoint is whole, but this version cannot go on from its layout."""


@dataclass(frozen=True)
class Snapshot:
    """The content of a checkpoint. arrays: by name, each with a fixed dtype. document: values that JSON can hold."""

    arrays: dict[str, Array] = field(default_factory=dict)
    document: dict[str, Any] = field(default_factory=dict)

    @property
    def dtypes(self) -> DTypes:
        """The dtypes of the arrays."""
        return {name: array.dtype for name, array in self.arrays.items()}


Decode = Callable[[bytes], Snapshot]
"""Returns the snapshot in the bytes of a checkpoint. Raises CheckpointError."""


class Checkpoints(Protocol):
    """A place for checkpoints of one layout."""

    def write(self, snapshot: Snapshot) -> int:
        """Write the newest checkpoint. Return its size in bytes.

        Raises OSError or CheckpointError; the previous checkpoint is then still the newest.
        """

    def newest(self) -> tuple[Snapshot | None, list[str]]:
        """Return the newest undamaged snapshot, None if there is none, and why each newer one is not used."""


def encoded(snapshot: Snapshot, layout: str) -> list[bytes | memoryview]:
    """Return the bytes of a checkpoint in parts, so that the arrays are not copied."""
    arrays = {name: np.ascontiguousarray(array) for name, array in snapshot.arrays.items()}
    header = {
        "layout": layout,
        "columns": described(snapshot.dtypes),
        "shapes": {name: array.shape for name, array in arrays.items()},
        "document": snapshot.document,
    }
    content = [array.reshape(-1).view(np.uint8).data for array in arrays.values()]
    parts: list[bytes | memoryview] = [orjson.dumps(header) + b"\n", *content]
    digest = hashlib.blake2b(digest_size=_DIGEST_BYTES)
    for part in parts:
        digest.update(part)
    return [*parts, digest.digest()]


def decoded(whole: bytes) -> tuple[str, Snapshot]:
    """Return the layout of a checkpoint, and the snapshot in its bytes. Raises CheckpointError."""
    content, digest = memoryview(whole)[:-_DIGEST_BYTES], whole[-_DIGEST_BYTES:]
    if hashlib.blake2b(content, digest_size=_DIGEST_BYTES).digest() != digest:
        raise CheckpointError("it is damaged (its checksum is wrong)")
    start = whole.index(b"\n") + 1
    header = orjson.loads(content[:start])
    if "columns" not in header:  # the first layout, which had no number
        raise UnreadableLayoutError(f"its layout is {header['layout']}, which this version does not read any more")
    arrays = _arrays(header["shapes"], content[start:], dtypes_of(header["columns"]))
    return header["layout"], Snapshot(dict(arrays), header["document"])


def _arrays(shapes: Mapping[str, list[int]], content: memoryview, dtypes: DTypes) -> Iterator[tuple[str, Array]]:
    start = 0
    for name, shape in shapes.items():
        array = np.empty(shape, dtypes[name])
        array.reshape(-1).view(np.uint8)[:] = np.frombuffer(content[start : start + array.nbytes], np.uint8)
        yield name, array
        start += array.nbytes

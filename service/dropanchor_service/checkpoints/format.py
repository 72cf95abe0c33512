"""The bytes of a checkpoint, and what a place for checkpoints offers. A checksum detects damage.

A checkpoint is one line of JSON (layout, columns and shapes of the arrays, and the document), then the arrays,
little-endian as in memory. It is packed by Zstandard, which makes an eighth of it, and sealed by a BLAKE2b digest.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import orjson
import zstandard

from dropanchor_service.checkpoints.layouts import DTypes, described, dtypes_of
from dropanchor_service.estimation.columns import Array

_DIGEST_BYTES = 32
_LEVEL = 1  # higher ones take longer and save less than a tenth


class CheckpointError(Exception):
    """A checkpoint cannot be used or written; the message says why."""


class UnreadableLayoutError(CheckpointError):
    """A checkpoint is whole, but this version cannot go on from its layout."""


@dataclass(frozen=True)
class Snapshot:
    """The content of a checkpoint. arrays: by name, each with a fixed dtype. document: values that JSON can hold."""

    arrays: dict[str, Array] = field(default_factory=dict)
    document: dict[str, Any] = field(default_factory=dict)

    def copy(self) -> "Snapshot":
        """Return a snapshot with arrays of its own."""
        return Snapshot({name: array.copy() for name, array in self.arrays.items()}, self.document)

    @property
    def dtypes(self) -> DTypes:
        """The dtypes of the arrays."""
        return {name: array.dtype for name, array in self.arrays.items()}


AsPresent = Callable[[str, Snapshot], Snapshot]
"""Takes a snapshot and its layout, and returns it in the present layout. Raises CheckpointError."""


class Checkpoints(Protocol):
    """A place for checkpoints of one layout."""

    def write(self, snapshot: Snapshot) -> int:
        """Write the newest checkpoint. Return its size in bytes.

        Raises OSError or CheckpointError; the previous checkpoint is then still the newest.
        """

    def newest(self) -> tuple[Snapshot | None, list[str]]:
        """Return the newest undamaged snapshot, None if there is none, and why each newer one is not used."""


def encoded(snapshot: Snapshot, layout: str) -> list[bytes]:
    """Return the bytes of a checkpoint, in parts."""
    header = {
        "layout": layout,
        "columns": described(snapshot.dtypes),
        "shapes": {name: array.shape for name, array in snapshot.arrays.items()},
        "document": snapshot.document,
    }
    return sealed(header, map(bytes_of, snapshot.arrays.values()))


def decoded(whole: bytes) -> tuple[str, Snapshot]:
    """Return the layout of a checkpoint, and the snapshot in its bytes. Raises CheckpointError."""
    header, content = unsealed(whole)
    if "columns" not in header:  # the first layout, which had no number
        raise UnreadableLayoutError(f"its layout is {header['layout']}, which this version does not read any more")
    arrays = _arrays(header["shapes"], content, dtypes_of(header["columns"]))
    return header["layout"], Snapshot(dict(arrays), header["document"])


def _arrays(shapes: Mapping[str, list[int]], content: memoryview, dtypes: DTypes) -> Iterator[tuple[str, Array]]:
    start = 0
    for name, shape in shapes.items():
        array = np.empty(shape, dtypes[name])
        bytes_of(array)[:] = np.frombuffer(content[start : start + array.nbytes], np.uint8)
        yield name, array
        start += array.nbytes


def bytes_of(array: Array) -> Array:
    """Return the bytes of an array (in one piece), in the memory of the array."""
    return array.reshape(-1).view(np.uint8)


def sealed(header: Mapping[str, Any], arrays: Iterable[Array], level: int = _LEVEL) -> list[bytes]:
    """Return a line of JSON and the bytes of arrays behind it, packed, and the digest of that."""
    packing, digest = zstandard.ZstdCompressor(level).compressobj(), hashlib.blake2b(digest_size=_DIGEST_BYTES)
    packed = [packing.compress(orjson.dumps(header) + b"\n"), *(packing.compress(array.data) for array in arrays)]
    packed.append(packing.flush())
    for part in packed:
        digest.update(part)
    return [*packed, digest.digest()]


def size_of(parts: Iterable[bytes]) -> int:
    """Return how many bytes a checkpoint in parts has."""
    return sum(map(len, parts))


def unsealed(whole: bytes) -> tuple[dict[str, Any], memoryview]:
    """Return what `sealed` was given. Raises CheckpointError if it is damaged."""
    content, digest = whole[:-_DIGEST_BYTES], whole[-_DIGEST_BYTES:]
    if hashlib.blake2b(content, digest_size=_DIGEST_BYTES).digest() != digest:
        raise CheckpointError("it is damaged (its checksum is wrong)")
    if not content.startswith(b"{"):  # earlier versions did not pack
        content = zstandard.ZstdDecompressor().decompressobj().decompress(content)
    start = content.index(b"\n") + 1
    return orjson.loads(content[:start]), memoryview(content)[start:]

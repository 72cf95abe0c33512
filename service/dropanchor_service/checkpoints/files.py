"""Write and read checkpoints in a folder. A checksum detects damaged files, and the last two checkpoints are kept.

A file is one line of JSON (layout, names and shapes of the arrays, and the document), then the arrays, little-endian as
in memory, then the BLAKE2b digest of everything before it.
"""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from dropanchor_service.estimation.columns import Array
from dropanchor_service.runtime.atomic_file import write_atomically

KEPT = 2
_PREFIX = "checkpoint-"
_DIGEST_BYTES = 32


class CheckpointError(Exception):
    """A checkpoint cannot be used; the message says why."""


@dataclass(frozen=True)
class Snapshot:
    """The content of a checkpoint. arrays: by name, each with a fixed dtype. document: values that JSON can hold."""

    arrays: dict[str, Array] = field(default_factory=dict)
    document: dict[str, Any] = field(default_factory=dict)


def layout_of(snapshot: Snapshot, meaning: str) -> str:
    """Return an identifier of the dtypes and keys of a snapshot.

    meaning: text that differs between versions in which the same numbers have another meaning.
    """
    dtypes = [(name, str(np.lib.format.dtype_to_descr(array.dtype))) for name, array in snapshot.arrays.items()]
    text = repr((meaning, sorted(dtypes), sorted(snapshot.document)))
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


class CheckpointFolder:
    """Checkpoints of one layout in a folder. Not thread-safe.

    template: any snapshot of this layout, for its dtypes.
    """

    def __init__(self, folder: Path, layout: str, template: Snapshot) -> None:
        self._folder = folder
        self._layout = layout
        self._dtypes = {name: array.dtype for name, array in template.arrays.items()}
        self._next = max((_number(path) for path in self._files()), default=0) + 1

    def write(self, snapshot: Snapshot) -> int:
        """Write the newest checkpoint. Return its size in bytes.

        Raises OSError; the previous checkpoint is then still the newest.
        """
        parts = _parts(snapshot, self._layout)
        path = self._folder / f"{_PREFIX}{self._next:012d}"
        self._next += 1
        write_atomically(path, parts)
        for old in self._files()[:-KEPT]:
            with suppress(OSError):
                old.unlink()
        return sum(memoryview(part).nbytes for part in parts)

    def newest(self) -> tuple[Snapshot | None, list[str]]:
        """Return the newest undamaged snapshot, None if there is none, and why each newer file is not used."""
        complaints: list[str] = []
        for path in reversed(self._files()):
            try:
                return self._read(path), complaints
            except (OSError, CheckpointError) as error:
                complaints.append(f"{path.name} is not used: {error}")
        return None, complaints

    def _read(self, path: Path) -> Snapshot:
        whole = path.read_bytes()
        content, digest = memoryview(whole)[:-_DIGEST_BYTES], whole[-_DIGEST_BYTES:]
        if hashlib.blake2b(content, digest_size=_DIGEST_BYTES).digest() != digest:
            raise CheckpointError("it is damaged (its checksum is wrong)")
        start = whole.index(b"\n") + 1
        header = orjson.loads(content[:start])
        if header["layout"] != self._layout:
            raise CheckpointError(f"its layout is {header['layout']}, but this version uses {self._layout}")
        return Snapshot(dict(self._arrays(header["shapes"], content[start:])), header["document"])

    def _arrays(self, shapes: Mapping[str, list[int]], content: memoryview) -> Iterator[tuple[str, Array]]:
        start = 0
        for name, shape in shapes.items():
            array = np.empty(shape, self._dtypes[name])
            array.reshape(-1).view(np.uint8)[:] = np.frombuffer(content[start : start + array.nbytes], np.uint8)
            yield name, array
            start += array.nbytes

    def _files(self) -> list[Path]:
        """Return the checkpoints, the oldest first."""
        found = [path for path in self._folder.glob(f"{_PREFIX}*") if path.name[len(_PREFIX) :].isdecimal()]
        return sorted(found, key=_number)


def _number(path: Path) -> int:
    return int(path.name[len(_PREFIX) :])


def _parts(snapshot: Snapshot, layout: str) -> list[bytes | memoryview]:
    arrays = {name: np.ascontiguousarray(array) for name, array in snapshot.arrays.items()}
    header = {
        "layout": layout,
        "shapes": {name: array.shape for name, array in arrays.items()},
        "document": snapshot.document,
    }
    content = [array.reshape(-1).view(np.uint8).data for array in arrays.values()]
    parts: list[bytes | memoryview] = [orjson.dumps(header) + b"\n", *content]
    digest = hashlib.blake2b(digest_size=_DIGEST_BYTES)
    for part in parts:
        digest.update(part)
    return [*parts, digest.digest()]

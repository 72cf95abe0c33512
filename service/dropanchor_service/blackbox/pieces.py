"""The files of a black box: pieces, each with a checkpoint and then the turns after it.

A piece is a series of records: a few bytes that say what follows, how long it is and of which time, and what follows,
sealed by a digest. What a kill or a full disk leaves of the last record is not read. So a piece may be run by itself,
and goes on with the next one of the same process.
"""

import os
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from dropanchor_service.blackbox.block import Doubts
from dropanchor_service.checkpoints.format import CheckpointError, Snapshot, decoded, encoded, sealed, size_of, unsealed
from dropanchor_service.runtime.open_below import open_below
from dropanchor_service.store.site_values import SiteDocument

FOLDER = "blackbox"
SUFFIX = ".box"
_NAME = re.compile(r"(\d{19})-([0-9a-f]{16})\.box")
_PREFIX = struct.Struct("<4sQqq")  # kind, bytes, from, to
HEAD, STATE, TURNS = b"HEAD", b"STAT", b"TURN"
MAX_RECORD = 2**30
ROOM_SHARE, MOST_ROOM = 0.02, 256 * 2**20
"""So much of a disk a black box leaves to others: what is to survive a restart needs it more."""


class Limits(NamedTuple):
    """How much of the past is kept: both limits apply."""

    max_bytes: int
    keep_ns: int


class Head(NamedTuple):
    """What a run of a piece needs beside its checkpoint. metadata: as in a recording. documents: by site.

    doubts: of anchors, at the beginning.
    """

    metadata: Mapping[str, str]
    documents: Mapping[str, SiteDocument]
    defaults: Mapping[str, Any]
    doubts: Doubts = ()

    def packed(self) -> list[bytes]:
        documents = {site: document.model_dump(mode="json") for site, document in self.documents.items()}
        return sealed(self._asdict() | {"documents": documents}, [])


@dataclass(frozen=True)
class Piece:
    """A file. session: of the process that wrote it: pieces of one session follow each other without a gap."""

    path: Path
    from_ns: int
    session: str

    def records(self, *kinds: bytes, from_ns: int = 0, to_ns: int = 2**62) -> Iterator[tuple[bytes, bytes]]:
        """Yield kind and content of the whole records of these kinds that touch a time.

        Raises OSError, and CheckpointError where the file is cut or no record follows.
        """
        with open_below(self.path.parent, self.path.name) as file:
            while len(prefix := file.read(_PREFIX.size)) == _PREFIX.size:
                kind, length, first_ns, last_ns = _PREFIX.unpack(prefix)
                if length > MAX_RECORD or kind not in (HEAD, STATE, TURNS):
                    raise CheckpointError("it is damaged")
                if kind in kinds and (kind != TURNS or (last_ns >= from_ns and first_ns <= to_ns)):
                    content = file.read(length)
                    if len(content) < length:
                        raise CheckpointError("it is cut")
                    yield kind, content
                else:
                    file.seek(length, os.SEEK_CUR)

    def head(self) -> Head:
        """Raises OSError, and CheckpointError if it is damaged."""
        for _, content in self.records(HEAD):
            header, _ = unsealed(content)
            documents = {site: SiteDocument.model_validate(one) for site, one in header["documents"].items()}
            return Head(header["metadata"], documents, header["defaults"], header.get("doubts", ()))
        raise CheckpointError("it has no beginning")

    def checkpoint(self) -> tuple[str, Snapshot] | None:
        """Return the layout and the snapshot of the checkpoint, None where the engine keeps no state. See `head`."""
        kind, content = next(self.records(STATE, TURNS), (TURNS, b""))
        return decoded(content) if kind == STATE else None

    def size(self) -> int:
        with suppress(OSError):
            return self.path.stat().st_size
        return 0


def pieces_in(folder: Path) -> list[Piece]:
    """Return the pieces in a folder, the oldest first."""
    found = [(_NAME.fullmatch(path.name), path) for path in folder.glob(f"*{SUFFIX}")]
    return sorted((Piece(path, int(name[1]), name[2]) for name, path in found if name), key=lambda piece: piece.from_ns)


class OpenPiece:
    """The piece that is being written. Creating it raises OSError."""

    def __init__(self, folder: Path, from_ns: int, session: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / f"{from_ns:019d}-{session}{SUFFIX}"
        self._fd = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
        self.size = 0

    def begin(self, t_ns: int, head: Head, layout: str, snapshot: Snapshot | None) -> int:
        """Write what a run needs. Return the size of the checkpoint. Raises OSError."""
        self._add(HEAD, head.packed(), t_ns, t_ns)
        before = self.size
        if snapshot is not None:
            self._add(STATE, encoded(snapshot, layout), t_ns, t_ns)
        return self.size - before

    def add_turns(self, parts: Sequence[bytes], from_ns: int, to_ns: int) -> None:
        """Write the bytes of turns. Raises OSError, and then the file is as before."""
        self._add(TURNS, parts, from_ns, to_ns)

    def _add(self, kind: bytes, parts: Sequence[bytes], from_ns: int, to_ns: int) -> None:
        whole = b"".join([_PREFIX.pack(kind, size_of(parts), from_ns, to_ns), *parts])
        written = 0
        try:
            while written < len(whole):
                written += os.write(self._fd, memoryview(whole)[written:])
        except OSError:
            os.ftruncate(self._fd, self.size)
            os.lseek(self._fd, self.size, os.SEEK_SET)
            raise
        self.size += written

    def close(self) -> None:
        """Close the file, and remove it if nothing could be written."""
        os.close(self._fd)
        if not self.size:
            with suppress(OSError):
                self.path.unlink()


def prune(folder: Path, limits: Limits, now_ns: int, open_path: Path | None) -> None:
    """Delete the oldest pieces until the limits hold and others have room on the disk, but never the open one.

    Raises OSError.
    """
    pieces = pieces_in(folder)
    total = sum(piece.size() for piece in pieces)
    for piece, after in zip(pieces, [*pieces[1:], None], strict=True):
        is_old = after is not None and after.from_ns < now_ns - limits.keep_ns
        if piece.path == open_path or not (is_old or total > limits.max_bytes or lacks_room(folder)):
            return
        total -= piece.size()
        piece.path.unlink(missing_ok=True)


def lacks_room(folder: Path) -> bool:
    """Return whether the disk has too little room for others. Raises OSError."""
    disk = os.statvfs(folder)
    return disk.f_bavail * disk.f_frsize < min(MOST_ROOM, ROOM_SHARE * disk.f_blocks * disk.f_frsize)


def drop_oldest(folder: Path, open_path: Path | None) -> bool:
    """Delete the oldest piece but the open one. Return whether there was one. Raises OSError."""
    oldest = next((piece for piece in pieces_in(folder) if piece.path != open_path), None)
    if oldest is None:
        return False
    oldest.path.unlink(missing_ok=True)
    return True

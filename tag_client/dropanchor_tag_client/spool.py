"""A queue of messages on disk: first in, first out, bounded in bytes, and safe against a power cut."""

import errno
import os
import struct
import sys
import zlib
from collections import deque
from pathlib import Path

from dropanchor_tag_client.folder_lock import FolderInUseError, FolderLock

MIN_LIMIT_BYTES = 1_000_000
SEGMENT_BYTES = 262_144
_MAGIC = b"\x89DA\n"
_RECORD = struct.Struct("<4sII")  # magic, length of the message, its CRC-32
_POSITION = struct.Struct("<QQQ")  # counter, segment, offset of its first message that was not removed
_CRC = struct.Struct("<I")
_SLOT_BYTES = _POSITION.size + _CRC.size


class SpoolError(ValueError):
    """The folder cannot hold a spool. The message says what to do."""


class Spool:
    """Keep messages in a folder until they are removed. Not thread-safe. Raises SpoolError.

    Messages are appended to segments, files of about `SEGMENT_BYTES`. Only closed segments are read, and a new process
    begins a new segment. So a record that a crash cut off is always the last one of its segment.

    dropped: number of messages that were deleted because the spool was full, oldest first. damaged: number of places
    in segments that held no valid message.
    """

    def __init__(self, folder: Path, limit_bytes: int) -> None:
        if limit_bytes < MIN_LIMIT_BYTES:
            raise SpoolError(f"a spool needs at least {MIN_LIMIT_BYTES} bytes, not {limit_bytes}")
        self.dropped = 0
        self.damaged = 0
        self._folder = folder
        self._limit_bytes = limit_bytes
        self._file: int | None = None  # the open segment
        self._file_bytes = 0
        self._loaded: deque[tuple[int, bytes]] = deque()  # of the oldest segment: where the next record begins, message
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = FolderLock(folder, "lock")
            self._positions = _Positions(folder / "position")
            self._sizes = _segments(folder)
        except FolderInUseError as error:
            raise SpoolError(f"the spool {error}: stop it, or give each program a folder of its own") from None
        except OSError as error:
            raise SpoolError(f"the spool {folder} cannot be used: {error.strerror}") from error
        self._next_number = max([*self._sizes, self._positions.segment], default=0) + 1

    @property
    def is_empty(self) -> bool:
        return not self._sizes and self._file is None

    @property
    def used_bytes(self) -> int:
        """Return the bytes on disk."""
        return sum(self._sizes.values()) + self._file_bytes

    def append(self, message: bytes) -> None:
        """Write a message; it survives the end of the process, and after `sync` a power cut. Raises OSError."""
        record = _RECORD.pack(_MAGIC, len(message), zlib.crc32(message)) + message
        if self._file_bytes + len(record) > SEGMENT_BYTES:
            self._close_segment()
        while self._sizes and self.used_bytes + len(record) > self._limit_bytes:
            self._drop_oldest()
        if self._file is None:
            self._file = os.open(self._path(self._next_number), os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            self._sync_folder()
        if os.write(self._file, record) < len(record):
            os.ftruncate(self._file, self._file_bytes)
            os.lseek(self._file, self._file_bytes, os.SEEK_SET)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self._file_bytes += len(record)

    def sync(self) -> None:
        """Make the messages survive a power cut."""
        if self._file is not None:
            os.fsync(self._file)

    def peek(self, max_messages: int, max_bytes: int) -> list[bytes]:
        """Return the oldest messages, at least one unless the spool is empty."""
        while not self._loaded and not self.is_empty:
            if not self._sizes:
                self._close_segment()
            self._load(min(self._sizes))
        messages: list[bytes] = []
        left_bytes = max_bytes
        for _, message in self._loaded:
            left_bytes -= len(message)
            if messages and (left_bytes < 0 or len(messages) >= max_messages):
                break
            messages.append(message)
        return messages

    def ends_after(self, count: int) -> bool:
        """Return whether there is nothing behind the oldest messages, of which `peek` returned this many."""
        return len(self._loaded) == count and len(self._sizes) <= 1 and self._file is None

    def remove(self, count: int) -> None:
        """Remove the oldest messages, which `peek` returned, for good: they do not come back after a power cut."""
        for _ in range(count):
            offset, _ = self._loaded.popleft()
        oldest = min(self._sizes)
        if self._loaded:
            self._positions.write(oldest, offset)
        else:
            self._delete(oldest)

    def close(self) -> None:
        self._close_segment()
        self._positions.close()
        self._lock.close()

    def _path(self, number: int) -> Path:
        return self._folder / f"{number:016d}.spool"

    def _close_segment(self) -> None:
        if self._file is None:
            return
        os.fsync(self._file)
        os.close(self._file)
        self._sizes[self._next_number] = self._file_bytes
        self._file, self._file_bytes = None, 0
        self._next_number += 1

    def _load(self, number: int) -> None:
        """Read the messages of a segment; delete a segment that holds none."""
        begin = self._positions.offset if number == self._positions.segment else 0
        found, damaged = _records(self._path(number).read_bytes(), begin)
        self._loaded.extend(found)
        self.damaged += damaged
        if not found:
            self._delete(number)

    def _drop_oldest(self) -> None:
        oldest = min(self._sizes)
        if not self._loaded:
            self._load(oldest)
        self.dropped += len(self._loaded)
        self._loaded.clear()
        if oldest in self._sizes:
            self._delete(oldest)

    def _delete(self, number: int) -> None:
        self._path(number).unlink()
        self._sync_folder()
        del self._sizes[number]

    def _sync_folder(self) -> None:
        if sys.platform == "win32":  # a folder cannot be opened there
            return
        folder = os.open(self._folder, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


class _Positions:
    """A file with the position of the first message to send, in two slots that are written in turn.

    A power cut damages at most one of them. Segment 0 means that there is no position.
    """

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        slots = os.read(self._file, 2 * _SLOT_BYTES)
        self._counter, self.segment, self.offset = max(_position(slots[:_SLOT_BYTES]), _position(slots[_SLOT_BYTES:]))

    def write(self, segment: int, offset: int) -> None:
        self._counter += 1
        self.segment, self.offset = segment, offset
        data = _POSITION.pack(self._counter, segment, offset)
        os.lseek(self._file, self._counter % 2 * _SLOT_BYTES, os.SEEK_SET)
        os.write(self._file, data + _CRC.pack(zlib.crc32(data)))
        os.fsync(self._file)

    def close(self) -> None:
        os.close(self._file)


def _position(slot: bytes) -> tuple[int, int, int]:
    data, crc = slot[: _POSITION.size], slot[_POSITION.size :]
    if len(slot) < _SLOT_BYTES or crc != _CRC.pack(zlib.crc32(data)):
        return 0, 0, 0
    counter, segment, offset = _POSITION.unpack(data)
    return counter, segment, offset


def _records(data: bytes, begin: int) -> tuple[list[tuple[int, bytes]], int]:
    """Return the messages from this offset on, each with the offset after it, and the number of damaged places."""
    found: list[tuple[int, bytes]] = []
    damaged, at = 0, begin
    while at < len(data):
        message = _message(data, at)
        if message is not None:
            at += _RECORD.size + len(message)
            found.append((at, message))
            continue
        damaged += 1
        at = next((i for i in _magics(data, at + 1) if _message(data, i) is not None), len(data))
    return found, damaged


def _magics(data: bytes, begin: int) -> list[int]:
    """Return where a record may begin."""
    found: list[int] = []
    at = data.find(_MAGIC, begin)
    while at >= 0:
        found.append(at)
        at = data.find(_MAGIC, at + 1)
    return found


def _message(data: bytes, at: int) -> bytes | None:
    """Return the message of the record at this offset, None if there is no complete and undamaged one."""
    if at + _RECORD.size > len(data):
        return None
    magic, length, crc = _RECORD.unpack_from(data, at)
    begin = at + _RECORD.size
    message = data[begin : begin + length]
    return message if magic == _MAGIC and len(message) == length and zlib.crc32(message) == crc else None


def _segments(folder: Path) -> dict[int, int]:
    """Return the sizes of the segments that an earlier process left, by number."""
    return {int(path.stem): path.stat().st_size for path in folder.glob("*.spool") if path.stem.isdecimal()}

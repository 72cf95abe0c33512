"""One MCAP file that is being written: whole after every `drain`, whenever the process is killed."""

import json
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, cast

from mcap.writer import CompressionType, Writer

from dropanchor_service.recording import schemas
from dropanchor_service.runtime.atomic_file import sync_folder

PROFILE = "dropanchor"
METADATA = "dropanchor"
SESSION = "session"  # in the metadata: the same in files that continue each other
MOST_CHANNELS = 65_000  # their ids are u16


class TooManyChannelsError(Exception):
    """The file holds as many topics as a file can."""


class McapFile:
    """Messages gather in memory; `drain` makes a chunk of them and puts it on the disk, whole or not at all."""

    def __init__(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Raises OSError, also when the file exists."""
        self.path = path
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
        self._spool = _Spool()
        self._writer = Writer(cast("IO[Any]", self._spool), compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE)
        self._writer.add_metadata(METADATA, dict(metadata))
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._is_finished = False
        self.size = 0
        self.opened_ns = time.monotonic_ns()

    def add(self, topic: str, schema: str, log_ns: int, t_ns: int, message: bytes) -> None:
        """A message in JSON. Raises TooManyChannelsError."""
        channel = self._channels.get(topic)
        if channel is None:
            if len(self._channels) >= MOST_CHANNELS:
                raise TooManyChannelsError
            channel = self._channels[topic] = self._writer.register_channel(topic, "json", self._schema(schema))
        self._writer.add_message(channel, log_ns, message, t_ns)

    def drain(self) -> None:
        """Put down what was added. Raises OSError, and then the file is as it was, and may be drained again."""
        if not self._is_finished:
            self._writer.flush()
        written = 0
        try:
            while written < len(self._spool.pending):
                written += os.write(self._fd, memoryview(self._spool.pending)[written:])
        except OSError:
            os.ftruncate(self._fd, self.size)
            os.lseek(self._fd, self.size, os.SEEK_SET)
            raise
        self.size += written
        self._spool.pending = bytearray()

    def finish(self) -> None:
        """Write what makes the file seekable, and close it. Raises OSError, and then may be called again."""
        if not self._is_finished:
            self._writer.finish()
            self._is_finished = True
        self.drain()
        os.fsync(self._fd)
        sync_folder(self.path.parent)
        self.abandon()

    def abandon(self) -> None:
        """Close it as it is: readable, without an index."""
        os.close(self._fd)

    def _schema(self, name: str) -> int:
        if name not in self._schemas:
            text = json.dumps(schemas.all_schemas()[name]).encode()
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", text)
        return self._schemas[name]


class _Spool:
    """What the MCAP library has written and the disk has not got yet."""

    def __init__(self) -> None:
        self.pending = bytearray()
        self._told = 0

    def write(self, data: bytes) -> int:
        self.pending += data
        self._told += len(data)
        return len(data)

    def tell(self) -> int:
        return self._told

    def flush(self) -> None:
        """Nothing: `drain` does it."""

"""Write one MCAP file that stays readable whenever the process is killed."""

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
SESSION = "session"  # metadata key: files that continue each other have the same value
MAX_CHANNELS = 65_000  # channel ids are u16


class TooManyChannelsError(Exception):
    """The file has as many topics as the format allows."""


class McapBytes:
    """The bytes of an MCAP file. `add` collects messages; `taken` returns them as one chunk."""

    def __init__(self, metadata: Mapping[str, str]) -> None:
        self._output = _OutputBuffer()
        self._writer = Writer(cast("IO[Any]", self._output), compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE)
        self._writer.add_metadata(METADATA, dict(metadata))
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._is_finished = False

    def add(self, topic: str, schema: str, log_ns: int, t_ns: int, message: bytes) -> None:
        """Add a JSON message. log_ns and t_ns become `log_time` and `publish_time`. Raises TooManyChannelsError."""
        channel = self._channels.get(topic)
        if channel is None:
            if len(self._channels) >= MAX_CHANNELS:
                raise TooManyChannelsError
            channel = self._channels[topic] = self._writer.register_channel(topic, "json", self._schema(schema))
        self._writer.add_message(channel, log_ns, message, t_ns)

    def taken(self) -> bytes:
        """Return what was added since the last call."""
        if not self._is_finished:
            self._writer.flush()
        found, self._output.pending = bytes(self._output.pending), bytearray()
        return found

    def end(self) -> bytes:
        """Return what was added since the last call, and the index. Nothing may be added any more."""
        self._end()
        return self.taken()

    def _end(self) -> None:
        if not self._is_finished:
            self._writer.finish()
            self._is_finished = True

    def _schema(self, name: str) -> int:
        if name not in self._schemas:
            text = json.dumps(schemas.all_schemas()[name]).encode()
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", text)
        return self._schemas[name]


class McapFile(McapBytes):
    """An MCAP file. `flush` appends the added messages as one chunk, whole or not at all."""

    def __init__(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Create the file. Raises OSError, also when the file exists."""
        self.path = path
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
        super().__init__(metadata)
        self.size = 0
        self.opened_ns = time.monotonic_ns()

    def flush(self) -> None:
        """Write the added messages to the file.

        Raises OSError, and then the file is unchanged and `flush` may be called again.
        """
        if not self._is_finished:
            self._writer.flush()
        written = 0
        try:
            while written < len(self._output.pending):
                written += os.write(self._fd, memoryview(self._output.pending)[written:])
        except OSError:
            os.ftruncate(self._fd, self.size)
            os.lseek(self._fd, self.size, os.SEEK_SET)
            raise
        self.size += written
        self._output.pending = bytearray()

    def finish(self) -> None:
        """Write the index and close the file. Raises OSError, and then may be called again."""
        self._end()
        self.flush()
        os.fsync(self._fd)
        sync_folder(self.path.parent)
        os.close(self._fd)


class _OutputBuffer:
    """Collects what the MCAP library writes until `McapFile.flush` writes it to the disk."""

    def __init__(self) -> None:
        self.pending = bytearray()
        self._position = 0

    def write(self, data: bytes) -> int:
        self.pending += data
        self._position += len(data)
        return len(data)

    def tell(self) -> int:
        return self._position

    def flush(self) -> None:
        """Do nothing. The MCAP library calls this; `McapFile.flush` writes to the disk."""

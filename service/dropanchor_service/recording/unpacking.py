"""Unpack the chunks of a recording: never more than a limit, whatever a hostile or damaged file says of itself."""

import struct
from bz2 import BZ2Decompressor
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any
from zlib import crc32

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Chunk
from mcap.stream_reader import CRCValidationError, StreamReader

from dropanchor_tag_client.recording import RecordingError

MAX_UNPACKED = 2**27  # bytes; programs write chunks of some MiB, and never more than one message over that
MAX_RECORD = 2**30
READ_ERRORS = (McapError, struct.error, zstandard.ZstdError, RuntimeError, ValueError, EOFError)


class TooLargeError(RecordingError):
    """Something unpacks to more than the limit."""


def unpacked(compression: str, data: bytes, what: str, told: int = -1) -> bytes:
    """Return the bytes of compressed data. compression: none, zstd, lz4, bz2. told: how many they are.

    Raises TooLargeError before more than the limit is in memory, ValueError for another compression.
    """
    if told < 0 and compression == "zstd":
        told = zstandard.frame_content_size(data)
    if told <= MAX_UNPACKED:
        found = _start_of(compression, data, (told if told >= 0 else MAX_UNPACKED) + 1)
        if len(found) <= MAX_UNPACKED and told in (len(found), -1):
            return found
        if len(found) <= MAX_UNPACKED:
            raise ValueError(f"{what} does not hold the {told:,} bytes that it should")
    size = f"{told / 2**20:,.0f} MiB" if told > MAX_UNPACKED else "more"
    raise TooLargeError(
        f"{what} unpacks to {size}, and the limit is {MAX_UNPACKED // 2**20} MiB. If the file is to be trusted, write "
        "it again with smaller chunks"
    )


def _start_of(compression: str, data: bytes, count: int) -> bytes:
    """Return at most so many of the first bytes."""
    if compression in ("", "none"):
        return data
    if compression == "zstd":
        return zstandard.ZstdDecompressor().stream_reader(data).read(count)
    if compression == "lz4":
        start: bytes = LZ4FrameDecompressor().decompress(data, count)
        return start
    if compression == "bz2":
        return BZ2Decompressor().decompress(data, count)
    raise ValueError(f"the compression {compression} is not known")


def mcap_records(path: Path, validate_crcs: bool = False) -> Iterator[Any]:
    """Yield the records of an MCAP file, those of a chunk one by one. Raises TooLargeError and READ_ERRORS."""
    with path.open("rb") as file:
        chunks = 0
        reader = StreamReader(file, emit_chunks=True, validate_crcs=validate_crcs, record_size_limit=MAX_RECORD)
        for record in reader.records:
            if isinstance(record, Chunk):
                chunks += 1
                yield from _inside(record, f"{path}: chunk {chunks}", validate_crcs)
            else:
                yield record


def _inside(chunk: Chunk, what: str, validate_crc: bool) -> Iterator[Any]:
    data = unpacked(chunk.compression, chunk.data, what, chunk.uncompressed_size)
    if validate_crc and chunk.uncompressed_crc not in (0, crc32(data)):
        raise CRCValidationError(chunk.uncompressed_crc, crc32(data), chunk)
    inner = StreamReader(BytesIO(data), skip_magic=True, emit_chunks=True, record_size_limit=MAX_UNPACKED)
    with suppress(EndOfFile):
        yield from (record for record in inner.records if not isinstance(record, Chunk))

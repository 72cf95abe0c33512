"""A PMTiles file (version 3): its description when it is opened, and its tiles.

The package `pmtiles` of the extra `maps` knows the format. This module adds what a service needs: it does not map the
file into memory, since a file that gets shorter would then end the process; it limits every size; and it keeps the last
directories.
Format: https://github.com/protomaps/PMTiles/blob/main/spec/v3/spec.md
"""

import json
import os
import re
import zlib
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Any

from pmtiles.tile import (
    Compression,
    Entry,
    HeaderDict,
    MagicNumberNotFound,
    SpecVersionUnsupported,
    TileType,
    deserialize_directory,
    deserialize_header,
    find_tile,
    zxy_to_tileid,
)

from dropanchor_schemas.basemap import TileMediaType
from dropanchor_service.basemap.errors import UnreadableTileError, UnusableFileError

MAX_TILE_BYTES = 4 * 2**20
MAX_METADATA_BYTES = 8 * 2**20
MAX_DIRECTORY_BYTES = 2**20
DIRECTORIES_KEPT = 8

_HEADER_BYTES = 127
_MAX_DEPTH = 4
_MAX_ZOOM = 31
_GZIP = 31
_BEYOND_64_BITS = re.compile(rb"[\x80-\xff]{10}")
_MEDIA_TYPES: dict[TileType, TileMediaType] = {
    TileType.PNG: "image/png",
    TileType.JPEG: "image/jpeg",
    TileType.WEBP: "image/webp",
    TileType.AVIF: "image/avif",
    TileType.MVT: "application/vnd.mapbox-vector-tile",
}


class TileFile:
    """An open PMTiles file. Any thread may read tiles."""

    def __init__(self, path: Path) -> None:
        """Open the file. Raises OSError, and UnusableFileError with one sentence."""
        self._file = path.open("rb", buffering=0)
        self._lock = Lock()
        self._directory = lru_cache(DIRECTORIES_KEPT)(self._read_directory)
        try:
            self._header = _header(self._file.read(_HEADER_BYTES))
            self._directory(self._header["root_offset"], self._header["root_length"])
            self.metadata = self._read_metadata()
            self.version = _version(path, os.fstat(self._file.fileno()))
        except OSError:
            self.close()
            raise
        except (UnreadableTileError, UnusableFileError) as error:
            self.close()
            raise UnusableFileError(f"{path} {error}") from error
        self.media_type = _MEDIA_TYPES[self._header["tile_type"]]
        self.min_zoom, self.max_zoom = self._header["min_zoom"], self._header["max_zoom"]
        self.bounds = _bounds(self._header)

    def close(self) -> None:
        """Close the file. Later reads raise UnreadableTileError."""
        with self._lock:
            self._file.close()

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """Return the tile, not compressed; None: the file has no such tile. Raises UnreadableTileError."""
        tile_id, header = zxy_to_tileid(z, x, y), self._header
        offset, length = header["root_offset"], header["root_length"]
        for _ in range(_MAX_DEPTH):
            entry = find_tile(self._directory(offset, length), tile_id)
            if entry is None:
                return None
            if entry.run_length > 0:
                return self._content(header["tile_data_offset"] + entry.offset, entry.length)
            offset, length = header["leaf_directory_offset"] + entry.offset, entry.length
        raise UnreadableTileError("has directories inside each other without end")

    def _content(self, offset: int, length: int) -> bytes:
        if length > MAX_TILE_BYTES:
            raise UnreadableTileError(f"has a tile of {length} bytes; at most {MAX_TILE_BYTES} can be read")
        stored = self._bytes(offset, length)
        return stored if self._header["tile_compression"] is Compression.NONE else _inflated(stored, MAX_TILE_BYTES)

    def _read_directory(self, offset: int, length: int) -> list[Entry]:
        if length > MAX_DIRECTORY_BYTES:
            raise UnreadableTileError(f"has a directory of {length} bytes; at most {MAX_DIRECTORY_BYTES} can be read")
        stored = self._bytes(offset, length)
        # The package limits neither the size of a directory nor that of its numbers.
        if _BEYOND_64_BITS.search(_inflated(stored, MAX_DIRECTORY_BYTES)):
            raise UnreadableTileError("is damaged: a directory has a number of more than 64 bits")
        try:
            return deserialize_directory(stored)
        except EOFError as error:
            raise UnreadableTileError("is damaged: a directory ends too early") from error

    def _read_metadata(self) -> dict[str, Any]:
        length = self._header["metadata_length"]
        if length > MAX_METADATA_BYTES:
            raise UnreadableTileError(f"has {length} bytes of metadata; at most {MAX_METADATA_BYTES} can be read")
        try:
            metadata = json.loads(_inflated(self._bytes(self._header["metadata_offset"], length), MAX_METADATA_BYTES))
        except (ValueError, RecursionError) as error:
            raise UnreadableTileError("is damaged: its metadata are not JSON") from error
        return metadata if isinstance(metadata, dict) else {}

    def _bytes(self, offset: int, length: int) -> bytes:
        """Return `length` bytes. Raises UnreadableTileError where the file is shorter, fails or is closed."""
        try:
            with self._lock:
                self._file.seek(offset)
                found = self._file.read(length)
        except (OSError, ValueError, OverflowError) as error:
            raise UnreadableTileError(f"cannot be read: {error}") from error
        if len(found) < length:
            raise UnreadableTileError("is not complete: it ends too early")
        return found


def _header(content: bytes) -> HeaderDict:
    """Return the header of a file that can be shown. Raises UnusableFileError."""
    try:
        header = deserialize_header(content)
    except (MagicNumberNotFound, SpecVersionUnsupported, UnicodeDecodeError, IndexError) as error:
        raise UnusableFileError("is not a PMTiles file of version 3; `pmtiles convert` makes one") from error
    except ValueError as error:
        raise UnusableFileError(f"has a header that says what PMTiles version 3 does not know: {error}") from error
    if not header["min_zoom"] <= header["max_zoom"] <= _MAX_ZOOM:
        raise UnusableFileError(f"has the zoom levels {header['min_zoom']} to {header['max_zoom']}, which cannot be")
    tile_type, tiles, inner = header["tile_type"], header["tile_compression"], header["internal_compression"]
    if tile_type not in _MEDIA_TYPES:
        kinds = ", ".join(kind.name for kind in _MEDIA_TYPES)
        advice = "; the program `pmtiles convert` writes the type" if tile_type is TileType.UNKNOWN else ""
        raise UnusableFileError(f"has tiles of the type {tile_type.name}; the types {kinds} can be shown{advice}")
    if inner is not Compression.GZIP or tiles not in (Compression.GZIP, Compression.NONE):
        unreadable = tiles if inner is Compression.GZIP else inner
        raise UnusableFileError(f"has the compression {unreadable.name}; only GZIP can be read, and tiles with NONE")
    return header


def _bounds(header: HeaderDict) -> tuple[float, float, float, float]:
    """Return west, south, east and north, degrees: those of the world where the header makes no sense."""
    west, south = header["min_lon_e7"] / 1e7, header["min_lat_e7"] / 1e7
    east, north = header["max_lon_e7"] / 1e7, header["max_lat_e7"] / 1e7
    makes_sense = -180 <= west < east <= 180 and -90 <= south < north <= 90
    return (west, south, east, north) if makes_sense else (-180.0, -90.0, 180.0, 90.0)


def _inflated(stored: bytes, limit: int) -> bytes:
    """Return the content of gzip data. Raises UnreadableTileError if it is damaged or longer than `limit`."""
    inflater = zlib.decompressobj(_GZIP)
    try:
        content = inflater.decompress(stored, limit)
    except zlib.error as error:
        raise UnreadableTileError("is damaged: its gzip data cannot be read") from error
    if not inflater.eof or inflater.unused_data:
        raise UnreadableTileError(f"is damaged, or has a piece of more than {limit} bytes")
    return content


def _version(path: Path, found: os.stat_result) -> str:
    """Return a text that differs when another file has taken the place."""
    return sha256(f"{path} {found.st_size} {found.st_mtime_ns}".encode()).hexdigest()[:16]

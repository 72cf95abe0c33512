"""PMTiles files, images and vector tiles as tests need them."""

import gzip
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from PIL import Image
from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import write

OSM = '<a href="https://www.openstreetmap.org/copyright" target="_blank">&copy; OpenStreetMap</a>'

Tile = tuple[int, int, int]
"""Zoom, column and line."""
Colour = tuple[int, int, int]
Line = Sequence[tuple[int, int]]


def basemap_file(
    path: Path,
    tiles: Mapping[Tile, bytes],
    tile_type: TileType = TileType.PNG,
    compression: Compression = Compression.NONE,
    metadata: Mapping[str, Any] | None = None,
    bounds: tuple[float, float, float, float] = (-180, -90, 180, 90),
) -> Path:
    """Write a PMTiles file. compression: NONE or GZIP, of the tiles. bounds: west, south, east and north."""
    with write(str(path)) as writer:
        for z, x, y in sorted(tiles, key=lambda tile: zxy_to_tileid(*tile)):
            content = tiles[z, x, y]
            stored = gzip.compress(content, mtime=0) if compression is Compression.GZIP else content
            writer.write_tile(zxy_to_tileid(z, x, y), stored)
        header: dict[str, Any] = {"tile_type": tile_type, "tile_compression": compression}
        names = ("min_lon_e7", "min_lat_e7", "max_lon_e7", "max_lat_e7")
        header |= {name: round(1e7 * value) for name, value in zip(names, bounds, strict=True)}
        writer.finalize(header, {"attribution": OSM} if metadata is None else dict(metadata))
    return path


def image_tile(colour: Colour, kind: str = "PNG", size: int = 256) -> bytes:
    """Return an image of one colour."""
    content = io.BytesIO()
    Image.new("RGB", (size, size), colour).save(content, kind)
    return content.getvalue()


def vector_tile(layers: Mapping[str, Sequence[tuple[str, Line]]], key: str = "kind", extent: int = 4096) -> bytes:
    """Return a vector tile. layers: of each the features, a kind and a line; a closed one is a polygon."""
    return b"".join(_field(3, _layer(name, features, key, extent)) for name, features in layers.items())


def _layer(name: str, features: Sequence[tuple[str, Line]], key: str, extent: int) -> bytes:
    kinds = sorted({kind for kind, _ in features})
    return b"".join(
        [
            _varint(15 << 3) + _varint(2),
            _field(1, name.encode()),
            *(_field(2, _feature(kinds.index(kind), line)) for kind, line in features),
            _field(3, key.encode()),
            *(_field(4, _field(1, kind.encode())) for kind in kinds),
            _varint(5 << 3) + _varint(extent),
        ]
    )


def _feature(kind: int, line: Line) -> bytes:
    is_polygon = line[0] == line[-1]
    points = line[:-1] if is_polygon else line
    steps = [(x - before[0], y - before[1]) for before, (x, y) in zip([(0, 0), *points[:-1]], points, strict=True)]
    numbers = [(1 << 3) | 1, *map(_zigzag, steps[0]), ((len(steps) - 1) << 3) | 2]
    numbers += [_zigzag(value) for step in steps[1:] for value in step]
    geometry = b"".join(map(_varint, [*numbers, *([15] if is_polygon else [])]))
    tags = _field(2, _varint(0) + _varint(kind))
    return tags + _varint(3 << 3) + _varint(3 if is_polygon else 2) + _field(4, geometry)


def _zigzag(value: int) -> int:
    return 2 * value if value >= 0 else -2 * value - 1


def _field(number: int, content: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    found = b""
    while value > 127:
        found += bytes([value & 127 | 128])
        value >>= 7
    return found + bytes([value])

"""PMTiles files are read tile by tile; what is no such file, or damaged, is refused with one sentence."""

import gzip
import random
from pathlib import Path

import pytest
from pmtiles.tile import Compression, Entry, TileType, deserialize_header, serialize_directory, serialize_header

from dropanchor_service.basemap.errors import UnreadableTileError, UnusableFileError
from dropanchor_service.basemap.file import (
    MAX_DIRECTORY_BYTES,
    MAX_TILE_BYTES,
    TileFile,
)
from support.basemap_files import basemap_file, image_tile

RED = image_tile((255, 0, 0))
HEADER_BYTES = 127


def changed(path: Path, **header: object) -> Path:
    """Change values of the header of a file."""
    content = path.read_bytes()
    values = deserialize_header(content[:HEADER_BYTES]) | header
    path.write_bytes(serialize_header(values) + content[HEADER_BYTES:])  # type: ignore[arg-type]
    return path


def sentence_of(path: Path) -> str:
    with pytest.raises(UnusableFileError) as refused:
        TileFile(path)
    return str(refused.value)


@pytest.mark.parametrize("compression", [Compression.NONE, Compression.GZIP])
def test_tiles_come_as_they_were_written_and_others_are_none(tmp_path: Path, compression: Compression) -> None:
    tiles = {
        (z, x, y): f"tile {z} {x} {y}".encode() for z in range(8) for x in range(2**z) for y in range(2**z) if x != y
    }
    file = TileFile(basemap_file(tmp_path / "map.pmtiles", tiles, compression=compression))
    assert (file.media_type, file.min_zoom, file.max_zoom) == ("image/png", 1, 7)
    assert {tile: file.tile(*tile) for tile in tiles} == tiles
    assert file.tile(7, 5, 5) is None
    assert file.tile(0, 0, 0) is None
    assert file.tile(31, 2**31 - 1, 0) is None
    assert "OpenStreetMap" in file.metadata["attribution"]
    file.close()


def test_a_file_with_leaf_directories_is_read(tmp_path: Path) -> None:
    made = random.Random(1)
    tiles = {(9, x, y): made.randbytes(made.randint(4, 400)) for x in range(150) for y in range(150)}
    path = basemap_file(tmp_path / "map.pmtiles", tiles)
    assert deserialize_header(path.read_bytes()[:HEADER_BYTES])["leaf_directory_length"] > 0
    file = TileFile(path)
    assert {tile: file.tile(*tile) for tile in list(tiles)[::97]} == {tile: tiles[tile] for tile in list(tiles)[::97]}
    file.close()


@pytest.mark.parametrize(
    ("written", "bounds"),
    [
        ((13.3, 52.4, 13.5, 52.6), (13.3, 52.4, 13.5, 52.6)),
        ((13.5, 52.4, 13.3, 52.6), (-180, -90, 180, 90)),
        ((0, 0, 0, 0), (-180, -90, 180, 90)),
        ((-200, 0, 10, 10), (-180, -90, 180, 90)),
    ],
)
def test_bounds_that_make_no_sense_are_those_of_the_world(
    tmp_path: Path, written: tuple[float, float, float, float], bounds: tuple[float, float, float, float]
) -> None:
    file = TileFile(basemap_file(tmp_path / "map.pmtiles", {(0, 0, 0): RED}, bounds=written))
    assert file.bounds == bounds
    file.close()


def test_another_file_has_another_version(tmp_path: Path) -> None:
    versions = set()
    for size in (1, 2, 3):
        file = TileFile(basemap_file(tmp_path / "map.pmtiles", {(0, 0, 0): RED * size}))
        versions.add(file.version)
        file.close()
    assert len(versions) == 3


def test_what_cannot_be_a_base_map_is_refused_with_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "map.pmtiles"
    for content in (
        b"",
        b"PM\x02\x00" + b"\0" * 200,
        b"PMTiles\x02" + b"\0" * 200,
        b"\xff" * 200,
        b"SQLite format 3\0" * 20,
    ):
        path.write_bytes(content)
        assert sentence_of(path) == f"{path} is not a PMTiles file of version 3; `pmtiles convert` makes one"

    def refused(**header: object) -> str:
        return sentence_of(changed(basemap_file(path, {(0, 0, 0): RED}), **header)).removeprefix(f"{path} ")

    known = "the types PNG, JPEG, WEBP, AVIF, MVT can be shown"
    assert refused(tile_type=TileType.MLT) == f"has tiles of the type MLT; {known}"
    unknown = f"has tiles of the type UNKNOWN; {known}; the program `pmtiles convert` writes the type"
    assert refused(tile_type=TileType.UNKNOWN) == unknown
    only = "only GZIP can be read, and tiles with NONE"
    assert refused(tile_compression=Compression.BROTLI) == f"has the compression BROTLI; {only}"
    assert refused(tile_compression=Compression.UNKNOWN) == f"has the compression UNKNOWN; {only}"
    assert refused(internal_compression=Compression.ZSTD) == f"has the compression ZSTD; {only}"
    assert refused(min_zoom=3, max_zoom=2) == "has the zoom levels 3 to 2, which cannot be"
    assert refused(max_zoom=32) == "has the zoom levels 0 to 32, which cannot be"
    assert refused(root_offset=2**63).startswith("cannot be read: ")
    assert refused(metadata_offset=10**9) == "is not complete: it ends too early"
    assert refused(metadata_offset=0) == "is damaged: its gzip data cannot be read"
    assert refused(root_length=2**60) == f"has a directory of {2**60} bytes; at most {MAX_DIRECTORY_BYTES} can be read"


def test_an_unknown_number_in_the_header_is_refused(tmp_path: Path) -> None:
    path = basemap_file(tmp_path / "map.pmtiles", {(0, 0, 0): RED})
    content = bytearray(path.read_bytes())
    content[99] = 77
    path.write_bytes(content)
    assert "77 is not a valid TileType" in sentence_of(path)


@pytest.mark.parametrize("length", [60, 140, 200])
def test_a_file_that_ends_too_early_is_refused(tmp_path: Path, length: int) -> None:
    path = basemap_file(tmp_path / "map.pmtiles", {(0, 0, 0): RED})
    path.write_bytes(path.read_bytes()[:length])
    assert sentence_of(path)


def test_a_damaged_or_huge_tile_is_refused_and_its_neighbour_is_read(tmp_path: Path) -> None:
    bomb = gzip.compress(b"\0" * (MAX_TILE_BYTES + 1))
    tiles = {(1, 0, 0): RED, (1, 1, 0): b"not gzip", (1, 0, 1): bomb, (1, 1, 1): b"\0" * (MAX_TILE_BYTES + 1)}
    path = basemap_file(tmp_path / "map.pmtiles", tiles | {(1, 0, 0): gzip.compress(RED)})
    file = TileFile(changed(path, tile_compression=Compression.GZIP))
    assert file.tile(1, 0, 0) == RED
    for tile, words in {(1, 1, 0): "gzip data", (1, 0, 1): "more than", (1, 1, 1): "at most"}.items():
        with pytest.raises(UnreadableTileError, match=words):
            file.tile(*tile)
    path.write_bytes(path.read_bytes()[:400])
    with pytest.raises(UnreadableTileError, match="ends too early"):
        file.tile(1, 0, 0)
    file.close()
    with pytest.raises(UnreadableTileError, match="closed"):
        file.tile(1, 0, 0)


def test_hostile_directories_are_refused(tmp_path: Path) -> None:
    own = serialize_directory([Entry(0, 0, 0, 0)])
    endless = [Entry(0, 0, len(own), 0)]
    many_bits = gzip.compress(b"\x01" + b"\xff" * 1000 + b"\x01")
    for directory, words in (
        (serialize_directory(endless), "without end"),
        (gzip.compress(b"\x01" * 9), None),
        (gzip.compress(b"\xff\xff\x03\x01"), "a directory ends too early"),
        (many_bits, "more than 64 bits"),
        (gzip.compress(b"\0" * (MAX_DIRECTORY_BYTES + 1)), "more than"),
    ):
        path = basemap_file(tmp_path / "map.pmtiles", {(0, 0, 0): RED})
        content = path.read_bytes()
        path.write_bytes(content + directory)
        changed(path, root_offset=len(content), root_length=len(directory), leaf_directory_offset=len(content))
        if words is None:
            TileFile(path).close()
        elif words == "without end":
            file = TileFile(path)
            with pytest.raises(UnreadableTileError, match=words):
                file.tile(0, 0, 0)
            file.close()
        else:
            assert words in sentence_of(path)


def test_whatever_bytes_are_damaged_the_file_is_read_or_refused(tmp_path: Path) -> None:
    tiles = {(2, x, y): f"{x} {y}".encode() for x in range(4) for y in range(4)}
    path = basemap_file(tmp_path / "map.pmtiles", tiles, compression=Compression.GZIP)
    whole, chance = path.read_bytes(), random.Random(7)
    outcomes = set()
    for _ in range(400):
        content = bytearray(whole)
        for _ in range(chance.randint(1, 3)):
            content[chance.randrange(min(len(content), 400))] = chance.randrange(256)
        path.write_bytes(content[: chance.choice((len(content), len(content), chance.randrange(len(content))))])
        try:
            file = TileFile(path)
        except UnusableFileError:
            outcomes.add("refused")
            continue
        for tile in tiles:
            try:
                outcomes.add("read" if file.tile(*tile) == tiles[tile] else "another")
            except UnreadableTileError:
                outcomes.add("unreadable")
        file.close()
    assert {"refused", "read", "unreadable"} <= outcomes

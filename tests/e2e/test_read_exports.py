"""Exports of a real service are read as the guide says, and every column has one type in every format and reader."""

import csv
import io
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import duckdb
import pandas as pd
import pyarrow.csv
import pyarrow.parquet as pq
import pytest

from dropanchor_evaluation.reference import fields_page
from dropanchor_schemas.wire import ENCODING_JSON, Frame, encode_json
from dropanchor_service.api.formats.track import NESTED, RELATIVES
from support.guides import blocks_of, follow
from support.s3 import running_s3
from support.service import Running, straight_north
from support.yard import running_yard
from support.zenoh_router import wait_until

GUIDE, TAG = "read-exports.md", "forklift-7"
EMPTY = [*RELATIVES, "floor_probability"]  # of a tag that knows north, on a site without floors
# What a reader of CSV has to be told.
TYPES = dict.fromkeys(("anchor", "floor"), "VARCHAR") | dict.fromkeys(EMPTY, "DOUBLE")
KINDS = {"i": "integer", "f": "number", "O": "text", "M": "timestamp", "U": "text"}
DUCKDB = {"BIGINT": "integer", "FLOAT": "number", "DOUBLE": "number", "VARCHAR": "text"}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running_yard(tmp_path_factory.mktemp("service"), TAG) as running:
        yield running


@pytest.fixture(scope="module")
def exports(service: Running, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an export in each format."""
    folder = tmp_path_factory.mktemp("exports")
    for form in ("csv", "parquet"):
        answer = service.ask("GET", f"/api/v1/tags/{TAG}/track/file?format={form}").raise_for_status()
        (folder / f"track.{form}").write_bytes(answer.content)
    return folder


@pytest.mark.parametrize("tool", ["pandas", "DuckDB"])
def test_the_guide_reads_the_exports(tool: str, service: Running, tmp_path: Path) -> None:
    blocks = [*blocks_of(GUIDE, ""), *blocks_of(GUIDE, tool)]
    pinned = " ".join(block.text for block in blocks if "pip install" in block.text)
    assert f"{tool.lower()}=={version(tool)}" in pinned  # pip changes nothing
    said = follow(blocks, tmp_path, service.url)
    poses = service.get(f"/api/v1/tags/{TAG}/track")["poses"]
    if tool == "pandas":
        assert f"{len(poses)} poses, " in said
        assert "x is in m" in said
        assert "CSV holds the same poses: True" in said
    else:
        assert f"[({poses[-1]['t_ns']}, '{poses[-1]['anchor']}', " in said
        assert "[(True,)]" in said


def test_the_guide_keeps_the_exports_in_s3(service: Running, tmp_path: Path) -> None:
    with running_s3():
        said = follow([*blocks_of(GUIDE, ""), *blocks_of(GUIDE, "S3")], tmp_path, service.url)
    assert f" poses of {TAG}" in said


@pytest.mark.parametrize("tool", ["pandas", "DuckDB"])
def test_the_guide_reads_the_exports_of_a_tag_without_any_place(tool: str, service: Running, tmp_path: Path) -> None:
    content, headers = encode_json(Frame(ranges=straight_north(20).ranges)), {"content-type": ENCODING_JSON}
    service.ask("POST", "/api/v1/ingest/samples?tag=cart", content=content, headers=headers).raise_for_status()
    wait_until(lambda: bool(service.ask("GET", "/api/v1/tags/cart/track").json().get("poses")))
    blocks = [*blocks_of(GUIDE, ""), *blocks_of(GUIDE, tool)]
    said = follow([replace(block, text=block.text.replace(TAG, "cart")) for block in blocks], tmp_path, service.url)
    assert ("[(None,)]" if tool == "DuckDB" else "CSV holds the same poses: True") in said


def test_pandas_pyarrow_and_duckdb_see_the_types_of_the_table_in_parquet(exports: Path) -> None:
    file = exports / "track.parquet"
    expected = fields_page.of_poses()["track, Parquet"]
    assert {field.name: fields_page.of_arrow(field.type) for field in pq.read_schema(file)} == expected
    assert kinds_of(pd.read_parquet(file)) == expected
    assert in_duckdb(f"SELECT * FROM '{file}'") == expected


def test_pandas_pyarrow_and_duckdb_see_the_types_of_the_table_in_csv(exports: Path) -> None:
    file = exports / "track.csv"
    expected = fields_page.of_poses()["track, CSV"] | {"t_utc": "timestamp"}  # readers know ISO 8601
    told = dict.fromkeys(("anchor", "floor"), pyarrow.string()) | dict.fromkeys(EMPTY, pyarrow.float64())
    options = pyarrow.csv.ConvertOptions(column_types=told)
    in_arrow = pyarrow.csv.read_csv(file, convert_options=options)
    assert {field.name: fields_page.of_arrow(field.type) for field in in_arrow.schema} == expected
    assert kinds_of(pd.read_csv(file, dtype={"anchor": "string", "floor": "string"}, parse_dates=["t_utc"])) == expected
    assert in_duckdb(f"SELECT * FROM read_csv('{file}', types = {TYPES})") == expected


def test_csv_parquet_geojson_and_json_hold_the_same_values(exports: Path, service: Running) -> None:
    poses = service.get(f"/api/v1/tags/{TAG}/track")["poses"]
    features = service.get(f"/api/v1/tags/{TAG}/track?format=geojson")["features"]
    assert [feature["properties"] for feature in features] == poses
    rows = list(csv.DictReader((exports / "track.csv").read_text().splitlines()))
    in_parquet = pq.read_table(exports / "track.parquet").drop(["t_utc"]).to_pylist()
    assert len(poses) == len(rows) == len(in_parquet) > 8
    assert any(pose["sigma_obs_m"] is None for pose in poses)
    for pose, row, stored in zip(poses, rows, in_parquet, strict=True):
        assert pose["relative_pose"] is None
        assert all(row[name] == "" and stored[name] is None for name in RELATIVES)
        for name in pose.keys() - {*NESTED, "t_utc"}:
            value = pose[name]
            is_number = isinstance(value, float)
            assert row[name] == ("" if value is None else str(value)), name
            assert stored[name] == (pytest.approx(value, rel=1e-6) if is_number else value), name
        assert float(row["cov_xh"]) == pose["covariance"][0][2]


def test_unknown_figures_are_empty_cells_that_readers_take_for_no_number(service: Running) -> None:
    text = service.ask("GET", "/api/v1/figures?format=csv").text
    figures = pd.read_csv(io.StringIO(text), dtype={"tag": "string"})
    expected = fields_page.of_figures()["figures, CSV"]
    assert {name: kinds_of(figures)[name] for name in expected} == expected
    assert "nan" not in text.lower()


def kinds_of(frame: pd.DataFrame) -> dict[str, str]:
    kinds = {name: KINDS.get(column.dtype.kind, "text") for name, column in frame.items()}
    return {str(name): kind for name, kind in kinds.items()}


def in_duckdb(query: str) -> dict[str, str]:
    described: list[tuple[Any, ...]] = duckdb.execute(f"DESCRIBE {query}").fetchall()
    return {name: DUCKDB.get(kind.split("(")[0], _other(kind)) for name, kind, *_ in described}


def _other(kind: str) -> str:
    return "timestamp" if kind.startswith("TIMESTAMP") else "text"

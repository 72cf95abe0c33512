"""Pages of a track as a Parquet file, written row group by row group. Needs the extra `parquet`."""

import io
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dropanchor_schemas.site import Site
from dropanchor_service.answers.track_pages import TrackPage
from dropanchor_service.api.formats.track import COVARIANCES, RELATIVES, covariances_of, relatives_of

GROUP_ROWS = 20_000
FRAME = (
    "x and y are east and north of the origin of the site in m, turned counter-clockwise by georeference.rotation_rad; "
    "z is the height along the z axis of the anchors, and georeference.alt_m the altitude of the height 0 m; "
    "the heading is counter-clockwise from x in rad; the columns relative_… are in a frame of the tag's own, turned "
    "about its anchor by an unknown angle"
)
_TEXTS = ("state", "reason", "frame", "anchor", "z_source", "floor")
_UNITS = {
    "t_ns": "ns since 1970-01-01 UTC",
    "t_utc": "UTC",
    "x": "m",
    "y": "m",
    "z": "m",
    "z_std_m": "m",
    "floor_probability": "1",
    "heading_rad": "rad",
    "speed_mps": "m/s",
    "yaw_rate_radps": "rad/s",
    "p_mode": "1",
    "sigma_pos_m": "m",
    "sigma_obs_m": "m",
    "range_m": "m",
    "lat": "degrees, WGS 84",
    "lon": "degrees, WGS 84",
    "alt_m": "m",
    "var_x": "m²",
    "cov_xy": "m²",
    "cov_xh": "m·rad",
    "var_y": "m²",
    "cov_yh": "m·rad",
    "var_h": "rad²",
    "epoch": "1",
}
_UNITS |= {name: _UNITS[name.removeprefix("relative_")] for name in RELATIVES}
_DEGREES = ("lat", "lon")  # a float32 would be 2 m wide
_ON_EARTH = (*_DEGREES, "alt_m")


def stream(pages: Iterable[TrackPage], tag: str, site: Site) -> Iterator[bytes]:
    """Yield one Parquet file with all pages. Not more than a row group is in memory."""
    sink = _Sink()
    schema = schema_of(tag, site)
    with pq.ParquetWriter(sink, schema, compression="zstd") as writer:
        for group in _groups(pages):
            writer.write_table(_table(group, schema))
            yield sink.taken()
    yield sink.taken()


class _Sink(io.RawIOBase):
    """A file that gives away what was written into it."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []
        self._written = 0

    def writable(self) -> bool:
        return True

    def write(self, content: Any) -> int:
        piece = bytes(content)
        self._pieces.append(piece)
        self._written += len(piece)
        return len(piece)

    def tell(self) -> int:
        return self._written

    def taken(self) -> bytes:
        pieces, self._pieces = self._pieces, []
        return b"".join(pieces)


def _groups(pages: Iterable[TrackPage]) -> Iterator[list[TrackPage]]:
    """Yield the pages of each row group."""
    group: list[TrackPage] = []
    for page in pages:
        group.append(page)
        if sum(map(len, group)) >= GROUP_ROWS:
            yield group
            group = []
    if any(map(len, group)):
        yield group


def schema_of(tag: str, site: Site) -> pa.Schema:
    """Return the columns, their types and units, and what the numbers mean."""
    origin = site.georeference
    known = [] if origin is None else [*_DEGREES, *(["alt_m"] if origin.alt_m is not None else [])]
    names = [name for name in _UNITS if name not in _ON_EARTH or name in known]
    numbers = [pa.field(name, _type_of(name), metadata={"unit": _UNITS[name]}) for name in names]
    texts = [pa.field(name, pa.dictionary(pa.int32(), pa.string())) for name in _TEXTS]
    metadata = {"tag": tag, "site": site.id, "frame": FRAME}
    metadata["georeference"] = "null" if origin is None else origin.model_dump_json()
    return pa.schema(
        [*numbers[:2], *texts, *numbers[2:]],
        metadata={f"dropanchor.{name}": text for name, text in metadata.items()},
    )


def _type_of(name: str) -> pa.DataType:
    if name == "t_ns":
        return pa.int64()
    if name == "t_utc":
        return pa.timestamp("ns", tz="UTC")
    if name == "epoch":
        return pa.int64()
    return pa.float64() if name in _DEGREES else pa.float32()


def _table(pages: Sequence[TrackPage], schema: pa.Schema) -> pa.Table:
    names = pages[0].columns
    columns: dict[str, Any] = {name: [value for page in pages for value in page.columns[name]] for name in names}
    variances = np.array([covariances_of(cov) for cov in columns.pop("covariance")]).reshape(-1, len(COVARIANCES))
    relatives = np.array([relatives_of(pose) for pose in columns.pop("relative_pose")]).reshape(-1, len(RELATIVES))
    columns |= dict(zip(COVARIANCES, variances.T, strict=True)) | dict(zip(RELATIVES, relatives.T, strict=True))
    columns["t_utc"] = columns["t_ns"]
    arrays = [pa.array(_known(columns[field.name], field.type), field.type, from_pandas=True) for field in schema]
    return pa.Table.from_arrays(arrays, schema=schema)


def _known(values: Any, kind: pa.DataType) -> Any:
    """Return the values with NaN, which becomes null, for every unknown number, as JSON has null for it."""
    if not pa.types.is_floating(kind):
        return values
    numbers = np.array(values, float)
    return np.where(np.isfinite(numbers), numbers, np.nan)

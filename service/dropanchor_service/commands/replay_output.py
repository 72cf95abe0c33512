"""Write the poses of a replay as CSV, JSON lines or Parquet, as the name of the file says."""

import csv
import gzip
import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from dropanchor_service.answers.frames import FRAMES, STATES, published_states
from dropanchor_service.answers.pose_fields import height_source_values
from dropanchor_service.estimation.columns import Array
from dropanchor_service.settings.sources import SettingsError

Write = Callable[[Iterable[Sequence[Any]]], None]
_NUMBERS = ("x", "y", "heading_rad", "speed_mps", "var_x", "cov_xy", "var_y", "p_mode", "z", "z_std")
_WORDS = ("state", "frame", "z_source")
VALUES = (*_NUMBERS, *_WORDS)
FORMATS = (".csv", ".csv.gz", ".jsonl", ".jsonl.gz", ".parquet")
SOURCE = "source"  # of a pose of a smoothed track: smoothed or filtered
_WHOLE, _TEXTS = ("t_ns",), ("tag", *_WORDS, SOURCE)


def values_of(poses: Array) -> Iterator[list[Any]]:
    """Yield VALUES of each POSE row. An unknown number is NaN. The numbers are in the frame that `frame` names."""
    cov = poses["cov"]
    columns = [*(poses[name] for name in ("x", "y", "heading", "speed"))]
    columns += [cov[:, 0, 0], cov[:, 0, 1], cov[:, 1, 1], *(poses[name] for name in ("p_mode", "z", "z_std"))]
    states, frames = published_states(poses["state"], poses["frame"]).tolist(), poses["frame"].tolist()
    numbers = zip(*(column.tolist() for column in columns), strict=True)
    for row, state, frame, source in zip(numbers, states, frames, height_source_values(poses), strict=True):
        yield [*row, STATES[state], FRAMES[frame], source]


def check(path: Path) -> None:
    """Raise SettingsError if the file cannot be written, ModuleNotFoundError without the package that it needs."""
    if path.suffix and not path.name.endswith(FORMATS):
        raise SettingsError(f"--out {path}: the name must end in {', '.join(FORMATS)}")
    if path.is_dir() or not path.parent.is_dir():
        raise SettingsError(f"--out {path}: give the name of a file in a folder that exists")
    if path.suffix == ".parquet":
        import_module("pyarrow")


def opened(path: Path, columns: Sequence[str]) -> AbstractContextManager[Write]:
    """Open a file for rows with these columns, as CSV if the name does not say otherwise. Raises OSError."""
    if path.name.endswith((".jsonl", ".jsonl.gz")):
        return _json_lines(path, columns)
    return _parquet(path, columns) if path.suffix == ".parquet" else _csv(path, columns)


def _text_file(path: Path) -> IO[str]:
    return gzip.open(path, "wt", newline="") if path.suffix == ".gz" else path.open("w", newline="")


@contextmanager
def _csv(path: Path, columns: Sequence[str]) -> Iterator[Write]:
    with _text_file(path) as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        yield lambda rows: writer.writerows([_cell(value) for value in row] for row in rows)


@contextmanager
def _json_lines(path: Path, columns: Sequence[str]) -> Iterator[Write]:
    with _text_file(path) as file:
        yield lambda rows: file.writelines(
            json.dumps(dict(zip(columns, map(_or_null, row), strict=True))) + "\n" for row in rows
        )


@contextmanager
def _parquet(path: Path, columns: Sequence[str]) -> Iterator[Write]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    def type_of(name: str) -> Any:
        return pa.int64() if name in _WHOLE else pa.string() if name in _TEXTS else pa.float64()

    schema = pa.schema([pa.field(name, type_of(name)) for name in columns])
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:

        def write(rows: Iterable[Sequence[Any]]) -> None:
            by_column = zip(*rows, strict=True)
            arrays = [
                pa.array(values, of.type, from_pandas=True) for values, of in zip(by_column, schema, strict=False)
            ]
            if arrays:  # there are rows
                writer.write_table(pa.Table.from_arrays(arrays, schema=schema))

        yield write


def _cell(value: Any) -> Any:
    """Return a number with six decimals, and an unknown one as an empty cell."""
    known = _or_null(value)
    return f"{known:.6f}" if isinstance(known, float) else known


def _or_null(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value

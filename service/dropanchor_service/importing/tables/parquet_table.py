"""Tables in Parquet."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from dropanchor_service.importing.files import File
from dropanchor_service.importing.readings import ImportingError, LeftOut
from dropanchor_service.importing.tables.flat import flat_rows
from dropanchor_service.importing.tables.table import RANGE_ADVICE, Row
from dropanchor_tag_client.recording.bounded import require_plausible


@dataclass(frozen=True)
class ParquetTable:
    """content: the table of pyarrow, its times as ns."""

    unit: ClassVar[str] = "row"
    name: str
    columns: tuple[str, ...]
    content: Any
    notes: tuple[str, ...] = ()
    anchor_advice: str = RANGE_ADVICE

    def rows(self, _: LeftOut) -> Iterator[Row]:
        """Yield the rows, numbered from 1."""
        numbered = 0
        for batch in self.content.to_batches():
            for value in batch.to_pylist():
                numbered += 1
                for row in flat_rows(value):
                    yield numbered, [row.get(column) for column in self.columns]


def read_parquet(file: File) -> ParquetTable:
    """Return the table of a file. Raises ImportingError."""
    try:
        import pyarrow as arrow
        import pyarrow.parquet as parquet
    except ImportError as error:
        raise ImportingError(
            f"{file.name} needs the extra `parquet`: pip install 'dropanchor-service[parquet]'"
        ) from error
    with file.opened() as raw:
        data = raw.read()
    try:
        source = parquet.ParquetFile(arrow.BufferReader(data))
        require_plausible(file.name, len(data), 8 * source.metadata.num_rows * len(source.schema_arrow))
        content = source.read()
    except (OSError, arrow.ArrowException) as error:
        raise ImportingError(f"{file.name} cannot be read: {error}") from error
    for place, column in enumerate(content.schema):
        if arrow.types.is_timestamp(column.type):
            times = content.column(place).cast(arrow.timestamp("ns")).cast(arrow.int64())
            content = content.set_column(place, column.name, times)
    names = dict.fromkeys(
        name for value in content.slice(0, 50).to_pylist() for row in flat_rows(value) for name in row
    )
    if not names:
        raise ImportingError(f"{file.name} holds no rows")
    return ParquetTable(file.name, tuple(names), content)

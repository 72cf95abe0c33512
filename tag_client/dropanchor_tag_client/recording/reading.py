"""Read recordings: folders of tables with the samples of a tag and optionally the truth."""

from array import array
from pathlib import Path

from dropanchor_tag_client.recording.columns import ANCHORS, HEADING, IMU, PRESSURE, RANGE, TRUTH
from dropanchor_tag_client.recording.order import put_in_order
from dropanchor_tag_client.recording.recording import Anchor, Recording, RecordingError
from dropanchor_tag_client.recording.table import Table, read_table
from dropanchor_tag_client.recording.units import settle_units

FARTHEST_M = 1e8  # wider than any map projection


def read_recording(folder: Path | str) -> Recording:
    """Return the recording in a folder. Raises RecordingError.

    range and anchors are required; imu, heading, pressure and truth are optional. See `columns` for their columns. The
    times are turned into seconds on the clock of the recording, in order.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise RecordingError(f"{folder} is not a folder; a recording is a folder with range.csv and anchors.csv")
    places = read_table(folder, ANCHORS)
    anchors = _anchors(places)
    tables = [read_table(folder, file) for file in (RANGE, IMU, HEADING, PRESSURE, TRUTH)]
    ranges, imu, headings, pressures, truth = tables
    _check_anchors(ranges, anchors, places)
    notes = settle_units(tables)
    for table in tables:
        notes += put_in_order(table)
    for table in (imu, headings, pressures):
        _check_common_time(table, ranges)
    return Recording(
        name=folder.resolve().name,
        anchors=anchors,
        range_anchors=tuple(ranges.texts),
        ranges=_columns(ranges),
        imu=_columns(imu),
        headings=_columns(headings),
        pressures=_columns(pressures),
        truth=_columns(truth),
        rows={table.file.name: table.rows for table in tables if len(table)},
        notes=tuple(notes),
    )


def _columns(table: Table) -> dict[str, "array[float]"]:
    return {"t_s": table.t, **table.values}


def _anchors(table: Table) -> tuple[Anchor, ...]:
    rows = zip(table.texts, *(table.values[name] for name in ("x", "y", "z")), strict=True)
    anchors = tuple(Anchor(*row) for row in rows)
    for row, anchor in enumerate(anchors):
        if not all(abs(value) < FARTHEST_M for value in (anchor.x, anchor.y, anchor.z)):
            raise RecordingError(f"{table.path.parent}: {table.rows.place(row)}: a position in m was expected")
    if not anchors:
        raise RecordingError(f"{table.path} holds no anchor")
    if len({anchor.id for anchor in anchors}) < len(anchors):
        raise RecordingError(f"{table.path} names an anchor twice")
    return anchors


def _check_anchors(ranges: Table, anchors: tuple[Anchor, ...], places: Table) -> None:
    unknown = sorted(set(ranges.texts) - {anchor.id for anchor in anchors})
    if unknown:
        there = f"{', '.join(unknown)}, which {places.rows.file} does not have"
        raise RecordingError(f"{places.path.parent}: ranges to {there}")


def _check_common_time(table: Table, ranges: Table) -> None:
    """Raise RecordingError if no sample of the table was measured between the first and the last range."""
    if not len(table) or not len(ranges) or (table.t[0] <= ranges.t[-1] and table.t[-1] >= ranges.t[0]):
        return
    spans = [f"{one.rows.file} holds {one.t[0]:.10g} to {one.t[-1]:.10g} s" for one in (table, ranges)]
    raise RecordingError(f"{table.path.parent}: {', '.join(spans)}: they have no time in common. Use one clock for all")

"""Readings of a table by a mapping, told or guessed."""

import shlex
from array import array
from collections.abc import Mapping, Sequence

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.readings import (
    NS_PER_S,
    RANGE,
    ImportingError,
    LeftOut,
    Readings,
    Unit,
    headings_of,
    ranges_of,
    stream_of,
)
from dropanchor_service.importing.tables.collect import ONLY_ANCHOR, Collected, Kind, collected
from dropanchor_service.importing.tables.guess import is_anchors, position_columns, unused, whole
from dropanchor_service.importing.tables.mapping import (
    ANCHOR,
    POSITION,
    QUANTITIES,
    T_NSEC,
    VECTORS,
    WIDE,
    Column,
    Fields,
    T,
    quantity_of,
    resolved,
)
from dropanchor_service.importing.tables.table import Table, number, text_of
from dropanchor_service.importing.tables.times import Times, past_midnight, times_of
from dropanchor_service.importing.tables.units import SI, conversion
from dropanchor_service.importing.tables.values import Sampled, counter_of, decided, may_be_ranges
from dropanchor_tag_client.recording.recording import Rows

_NEEDED = {RANGE, *(names[0] for names in VECTORS.values()), "heading"}


def fields_of(table: Table, told: Mapping[str, str]) -> dict[str, Column]:
    """Return the columns of a table by field: those that were told, the others guessed. Raises ImportingError.

    told: for each field the text that names its column, or nothing where it is not to be read. Those that the table
    does not have are left out.
    """
    columns = told_of(table, told)
    taken = [column.name for column in columns.values()]
    complete = T in columns and {*VECTORS["acc"], *VECTORS["gyro"], RANGE, ANCHOR} <= set(columns)
    fields = {} if complete else decided(Sampled(table), taken)
    is_wide = any(name.startswith(WIDE) for name in columns)
    replaced = {T_NSEC} if T in columns else set()
    replaced |= {RANGE, ANCHOR} if is_wide else set()
    replaced |= {name for name in fields if name.startswith(WIDE)} if RANGE in columns else set()
    replaced |= {name for name, text in told.items() if not text}
    return whole({name: column for name, column in fields.items() if name not in replaced} | columns)


def told_of(table: Table, told: Mapping[str, str]) -> dict[str, Column]:
    """Return the columns of this table that were told. Raises ImportingError."""
    return {name: column for name, text in told.items() if (column := resolved(text, table.columns, name))}


def why_unused(table: Table, fields: Fields) -> str:
    """Return why nothing of a table is used, and what would change that."""
    sampled = Sampled(table)
    if T in fields:
        why = f"{table.name}: not used: only its time is known, of {', '.join(table.columns[:12])}"
        return "; ".join([why, *_maybe_ranges(table, unused(table.columns, dict(fields)))])
    readings = [column.name for name, column in fields.items() if name in QUANTITIES]
    if not readings:
        return f"{table.name}: not used: its columns {', '.join(table.columns[:12])} hold no known reading"
    counter = counter_of(sampled)
    word = f"{table.name}/t={counter}:s/100" if counter else f"{table.name}/t=COLUMN:s"
    rate = ", where 100 is the number of its rows in a second" if counter else ""
    readings_of_it = ", ".join(readings[:9])
    return f"{table.name}: not used: no column tells the time of {readings_of_it}: --map {shlex.quote(word)}{rate}"


def is_useful(fields: Fields) -> bool:
    """Return whether the fields hold any reading with its time."""
    return T in fields and any(name in _NEEDED or name.startswith(WIDE) for name in fields)


def positions(table: Table, left_out: LeftOut) -> Readings | None:
    """Return the anchors of a table that holds their positions, None if it is no such table."""
    if not is_anchors(table.columns):
        return None
    index = {name: table.columns.index(column.name) for name, column in position_columns(table.columns).items()}
    readings = Readings(left_out=left_out)
    for line, cells in table.rows(left_out):
        try:
            x, y, z = (number(cells[index[axis]]) if axis in index else 0.0 for axis in POSITION[1:])
        except ValueError:
            x = y = z = None
        if x is None or y is None or z is None:
            left_out.add(table.name, "the position is not a number", line)
        else:
            readings.anchors[text_of(cells[index["id"]])] = x, y, z
    readings.notes.append(f"{table.name}: positions of anchors, taken as metres")
    return readings


def readings_of(table: Table, fields: Fields) -> Readings:
    """Return the readings of a table. Raises ImportingError where it has none."""
    readings = Readings()
    found = collected(table, fields, readings.left_out)
    if not found.times:
        raise ImportingError(f"{table.name}: no row has a time in the column {fields[T].name!r}")
    times = _times(found, fields)
    readings.notes += [
        f"{table.name}: {note}" for note in (*table.notes, *times.notes, *_conversions(table, fields, found))
    ]
    for quantity, kind in found.vectors.items():
        t_ns, columns, rows = _columns(kind, times, found, table)
        setattr(readings, quantity, stream_of(t_ns, np.column_stack(columns), rows, quantity, readings.left_out))
    t_ns, columns, rows = _columns(found.ranges, times, found, table)
    readings.ranges = ranges_of(t_ns, found.ranges.anchors, columns, rows, readings.left_out)
    t_ns, columns, rows = _columns(found.headings, times, found, table)
    readings.headings = headings_of(t_ns, columns, rows, readings.left_out)
    readings.units = _units(fields)
    readings.notes += _left(table, fields)
    return readings


def _left(table: Table, fields: Fields) -> list[str]:
    """Return a sentence on the columns that are not used, and one on those that may be ranges."""
    left = unused(table.columns, dict(fields))
    said = [f"{table.name}: not used: {', '.join(left[:12])}{', …' if len(left) > 12 else ''}"] if left else []
    has_ranges = any(name == RANGE or name.startswith(WIDE) for name in fields)
    return said if has_ranges else [*said, *_maybe_ranges(table, left)]


def _maybe_ranges(table: Table, columns: Sequence[str]) -> list[str]:
    """Return a sentence on those of the columns that may be ranges, if there are any."""
    maybe = may_be_ranges(Sampled(table), columns)
    words = " ".join(shlex.quote(f"{WIDE}{name}={name}:m") for name in maybe)
    return [f"{table.name}: are {', '.join(maybe)} ranges? --map {words} says so"] if maybe else []


def _times(found: Collected, fields: Fields) -> Times:
    column = fields[T]
    if not found.iso:
        unit = column.unit or ("s" if T_NSEC in fields else None)
        times = times_of(found.times, unit, column.name, found.lines)
    else:
        note, t_ns = f"{column.name} is ISO 8601", found.times
        note += " without a time zone: taken for UTC" if found.zoneless else ""
        if of_day := past_midnight(found.times):
            t_ns, midnights = of_day
            note = f"{column.name} is a time of day" + (f", {midnights} times past midnight" if midnights else "")
        times = times_of(t_ns, "ns", column.name, found.lines)
        times = times._replace(notes=[note, *times.notes])
    return times._replace(t_ns=times.t_ns + np.clip(found.seconds, 0, NS_PER_S)) if found.seconds else times


def _columns(kind: Kind, times: Times, found: Collected, table: Table) -> tuple[Array, list[Array], Rows]:
    """Return the times and the columns of readings of one kind, and where they stand."""
    rows = np.asarray(kind.rows, np.int64)
    lines = array("q", np.asarray(found.lines)[rows].tolist())
    return (
        times.t_ns[rows],
        [np.asarray(column) for column in kind.values.values()],
        Rows(table.name, table.unit, lines),
    )


def _conversions(table: Table, fields: Fields, found: Collected) -> list[str]:
    """Return a sentence for each conversion, and for each unit that was assumed."""
    sentences: dict[str, list[str]] = {}
    for name, column in fields.items():
        quantity = quantity_of(name)
        if quantity is None or name in (T, T_NSEC):
            continue
        unit = None if column.unit is None else conversion(column.unit, quantity)
        if unit is None:
            said = f"no unit is told: taken as {SI[quantity]}"
        elif unit.is_si:
            said = f"in {unit.name}"
        else:
            offset = " + 90°" if unit.offset else ""
            said = f"converted from {unit.name} to {SI[quantity]} (times {unit.factor:.10g}{offset})"
        sentences.setdefault(said, []).append(f"-{column.name}" if column.sign < 0 else column.name)
    lines = [f"{', '.join(columns)}: {said}" for said, columns in sentences.items()]
    if RANGE in fields and ANCHOR not in fields:
        lines.append(f"nothing names the anchor: the ranges are to anchor {ONLY_ANCHOR} ({table.anchor_advice})")
    if found.held:
        lines.append(f"{found.held} rows repeat the range before: they are no new ranges, and are left out")
    return lines


def _units(fields: Fields) -> dict[str, Unit]:
    units: dict[str, Unit] = {}
    for name, column in fields.items():
        quantity = quantity_of(name)
        if quantity is not None and name not in ("std", "heading_std", T):
            word = f"{name}={'-' if column.sign < 0 else ''}{column.name}"
            known = units.get(quantity)
            units[quantity] = Unit(column.unit, (*(known.given if known else ()), word))
    return units

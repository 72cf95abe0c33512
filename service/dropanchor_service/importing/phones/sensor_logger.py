"""Exports of the app Sensor Logger: a folder or zip with one CSV for each sensor, or one JSON with all of them.

Each CSV has the columns time (UTC in ns), seconds_elapsed, z, y, x. Metadata.csv tells the platform, and whether
"Standardise Units & Frames" was on. https://github.com/tszheichoi/awesome-sensor-logger
"""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dropanchor_service.importing.files import File
from dropanchor_service.importing.phones.phone import imu_readings
from dropanchor_service.importing.readings import ImportingError, LeftOut, Readings, stream_of
from dropanchor_service.importing.streams import Stream
from dropanchor_service.importing.tables.json_table import JsonTable, read_json
from dropanchor_service.importing.tables.table import Row, Table, exact_number, number
from dropanchor_service.importing.tables.text_table import read_table
from dropanchor_service.importing.tables.times import bounded
from dropanchor_tag_client.recording.recording import Rows
from dropanchor_tag_client.sources.phones.pairing import Signs
from dropanchor_tag_client.sources.phones.readings import SENSORS
from dropanchor_tag_client.sources.phones.sensor_logger import PA_PER_MBAR

_TIME, _VECTOR = "time", ("x", "y", "z")
_BAROMETER = "barometer"
_MARK = "seconds_elapsed"
_METADATA = "metadata"
_USED = (*SENSORS, _METADATA, _BAROMETER)
_SENSOR, _JSON = "sensor", ".json"  # of an export with all sensors in one file


def is_export(columns: Sequence[str]) -> bool:
    """Return whether a table with these columns comes from the app."""
    return _MARK in columns and {_TIME, *_VECTOR} <= set(columns)


def read_export(files: Sequence[File], source: str, signs: Signs) -> Readings:
    """Return the IMU and the barometer of an export. Raises ImportingError."""
    left_out = LeftOut()
    tables, unused = _tables(files)
    streams = {name: _stream(table, _VECTOR, left_out) for name, table in tables.items() if name in SENSORS}
    metadata = _metadata(tables[_METADATA]) if _METADATA in tables else {}
    told = signs if signs is not Signs.AUTO else _signs(metadata)
    readings = imu_readings({name: stream for name, stream in streams.items() if len(stream)}, told, source)
    if _BAROMETER in tables:
        mbar = _stream(tables[_BAROMETER], ("pressure",), left_out)
        readings.pressure = Stream(mbar.t_ns, PA_PER_MBAR * mbar.values)
    readings.left_out.add_all(left_out)
    readings.notes.insert(0, f"{source}: an export of Sensor Logger{_platform(metadata)}")
    if told is Signs.AUTO:
        readings.notes.append(
            f"{source}: nothing tells whether the phone is an iPhone; gravity tells the sign, while the screen is up "
            "(--signs ios or --signs android says it)"
        )
    elif told is Signs.IOS:
        readings.notes.append(f"{source}: accelerations of an iPhone: their sign is turned round")
    if unused:
        readings.notes.append(f"{source}: not used: {', '.join(unused[:8])}{', …' if len(unused) > 8 else ''}")
    return readings


@dataclass(frozen=True)
class _OfSensor:
    """The rows of one sensor in a table of all of them."""

    unit: ClassVar[str] = "line"
    name: str
    sensor: str
    table: JsonTable
    notes: tuple[str, ...] = ()
    anchor_advice: str = ""

    @property
    def columns(self) -> Sequence[str]:
        return self.table.columns

    def rows(self, left_out: LeftOut) -> Iterator[Row]:
        place = self.columns.index(_SENSOR)
        return (row for row in self.table.rows(left_out) if row[1][place] == self.sensor)


def _tables(files: Sequence[File]) -> tuple[dict[str, Table], list[str]]:
    """Return the table of each sensor that is known, by its name in lower case, and what the others are called."""
    tables: dict[str, Table] = {}
    others: list[str] = []
    for file in files:
        if file.stem in _USED:
            tables[file.stem] = read_table(file)
        elif file.name.lower().endswith(_JSON) and _SENSOR in (whole := read_json(file)).columns:
            names = dict.fromkeys(str(cells[whole.columns.index(_SENSOR)]) for _, cells in whole.rows(LeftOut()))
            found = {name.lower(): _OfSensor(f"{file.name}: {name}", name, whole) for name in names}
            tables |= {name: table for name, table in found.items() if name in _USED}
            others += [table.name for name, table in found.items() if name not in _USED]
        else:
            others.append(file.name)
    return tables, sorted(others)


def _stream(table: Table, columns: Sequence[str], left_out: LeftOut) -> Stream:
    if missing := {_TIME, *columns} - set(table.columns):
        raise ImportingError(f"{table.name} lacks the columns {', '.join(sorted(missing))} of Sensor Logger")
    places = [table.columns.index(name) for name in (_TIME, *columns)]
    t_ns, values, lines = array("q"), array("d"), array("q")
    for line, cells in table.rows(left_out):
        try:
            t, numbers = exact_number(cells[places[0]]), [number(cells[place]) for place in places[1:]]
        except ValueError:
            t, numbers = None, []
        if t is None or None in numbers:
            left_out.add(table.name, "a value is not a number", line)
        else:
            t_ns.append(bounded(t))
            lines.append(line)
            values.extend(value for value in numbers if value is not None)
    vectors = np.asarray(values).reshape(-1, len(columns))
    rows = Rows(table.name, table.unit, lines)
    return stream_of(np.asarray(t_ns, np.int64), vectors, rows, "readings", left_out)


def _metadata(table: Table) -> Mapping[str, str]:
    """Return the only row of the metadata, by column."""
    row = next((cells for _, cells in table.rows(LeftOut())), ())
    return dict(zip(table.columns, map(str, row), strict=False))


def _signs(metadata: Mapping[str, str]) -> Signs:
    """Return what the metadata tells of the sign of accelerations."""
    platform = metadata.get("platform", "").lower()
    if metadata.get("standardisation", "").lower() == "true" or platform == "android":
        return Signs.ANDROID
    return Signs.IOS if platform == "ios" else Signs.AUTO


def _platform(metadata: Mapping[str, str]) -> str:
    found = [metadata.get(name, "") for name in ("device name", "platform", "appVersion")]
    return f" ({', '.join(filter(None, found))})" if any(found) else ""

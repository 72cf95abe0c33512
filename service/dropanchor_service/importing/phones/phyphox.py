"""Exports of the app phyphox: a folder or zip with one CSV for each sensor, or one CSV with all of them.

The first column is "Time (s)", the others are "Acceleration x (m/s^2)", "Gyroscope x (rad/s)", "Magnetic field x (µT)",
"Pressure (hPa)".
meta/time.csv has the times at which the experiment began and paused. https://phyphox.org/wiki/index.php/Data_export
Both platforms give the specific force in the same axes; see `dropanchor_service.phones.phyphox`.
"""

import re
from array import array
from collections.abc import Mapping, Sequence

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.files import File
from dropanchor_service.importing.phones.phone import imu_readings
from dropanchor_service.importing.readings import ImportingError, LeftOut, Readings, bounded_ns, stream_of
from dropanchor_service.importing.streams import Stream, no_readings
from dropanchor_service.importing.tables.table import number
from dropanchor_service.importing.tables.text_table import TextTable, read_table
from dropanchor_service.importing.tables.times import UTC_S
from dropanchor_tag_client.recording.recording import Rows
from dropanchor_tag_client.sources.phones.pairing import Signs
from dropanchor_tag_client.sources.phones.readings import GYROSCOPE, LINEAR, MAGNETOMETER, TOTAL

_TIME = "Time (s)"
_AXIS = re.compile(r"(.+?) ([xyz]) \((.+)\)")
_SENSORS = {
    ("acceleration", "m/s^2"): TOTAL,
    ("linear acceleration", "m/s^2"): LINEAR,
    ("gyroscope", "rad/s"): GYROSCOPE,
    ("magnetic field", "µt"): MAGNETOMETER,
    ("magnetic field", "μt"): MAGNETOMETER,
}
_PRESSURES = {"pressure (hpa)": 100.0, "pressure (kpa)": 1_000.0, "pressure (pa)": 1.0}
_META = re.compile(r"(?:^|/)meta/")

Starts = tuple[Array, Array]
"""Experiment time and UTC at which the experiment began or went on, s."""


def is_export(columns: Sequence[str]) -> bool:
    """Return whether a table with these columns comes from the app."""
    return columns[:1] == (_TIME,) and bool(_sensors(columns))


def read_export(files: Sequence[File], source: str) -> Readings:
    """Return the IMU and the barometer of an export. Raises ImportingError."""
    left_out, starts = LeftOut(), _starts(files)
    streams: dict[str, Stream] = {}
    pressure = no_readings()
    for file in files:
        if _META.search(file.name) or not file.name.lower().endswith((".csv", ".txt", ".tsv")):
            continue
        table = read_table(file)
        for sensor, places in _sensors(table.columns).items():
            if sensor in streams:
                raise ImportingError(
                    f"{source}: the columns of {table.name} are {', '.join(table.columns)}, and another file has them, "
                    "too: make the export again, or leave one of the files out"
                )
            streams[sensor] = _stream(table, places, starts, left_out, sensor)
        for place, factor in _pressures(table.columns):
            sent = _stream(table, [place], starts, left_out, "pressures")
            pressure = Stream(sent.t_ns, factor * sent.values)
    readings = imu_readings({name: stream for name, stream in streams.items() if len(stream)}, Signs.ANDROID, source)
    readings.pressure = pressure
    readings.left_out.add_all(left_out)
    readings.notes.insert(0, f"{source}: an export of phyphox")
    if starts is None:
        readings.notes.append(f"{source}: without meta/time.csv its times count from the start of the experiment")
    return readings


def _sensors(columns: Sequence[str]) -> dict[str, list[int]]:
    """Return the places of x, y and z by sensor."""
    found: dict[str, dict[str, int]] = {}
    for place, name in enumerate(columns):
        match = _AXIS.fullmatch(name)
        sensor = match and _SENSORS.get((match[1].lower(), match[3].lower()))
        if match and sensor:
            found.setdefault(sensor, {})[match[2]] = place
    return {sensor: [axes[axis] for axis in "xyz"] for sensor, axes in found.items() if len(axes) == 3}


def _pressures(columns: Sequence[str]) -> list[tuple[int, float]]:
    """Return the place of each column of pressures, and how many Pa its unit is."""
    names = enumerate(name.lower() for name in columns)
    return [(place, _PRESSURES[name]) for place, name in names if name in _PRESSURES]


def _stream(table: TextTable, places: list[int], starts: Starts | None, left_out: LeftOut, what: str) -> Stream:
    times, values, lines = array("d"), array("d"), array("q")
    for line, cells in table.rows(left_out):
        try:
            t, *numbers = (number(cells[place]) for place in (0, *places))
        except ValueError:
            t = None
        if t is None or None in numbers:
            left_out.add(table.name, "a value is not a number", line)
        else:
            times.append(t)
            lines.append(line)
            values.extend(value for value in numbers if value is not None)
    t_ns = _t_ns(np.asarray(times), starts)
    rows = Rows(table.name, table.unit, lines)
    return stream_of(t_ns, np.asarray(values).reshape(-1, len(places)), rows, what, left_out)


def _t_ns(experiment_s: Array, starts: Starts | None) -> Array:
    """Return UTC by the last start before each time, or the times of the experiment."""
    if starts is None:
        return bounded_ns(experiment_s)
    began_s, utc_s = starts
    last = np.maximum(np.searchsorted(began_s, experiment_s, side="right") - 1, 0)
    utc_ns = np.rint(utc_s * 1e6).astype(np.int64) * 1000
    return utc_ns[last] + bounded_ns(experiment_s - began_s[last])


def _starts(files: Sequence[File]) -> Starts | None:
    file = next((file for file in files if _META.search(file.name) and file.stem == "time"), None)
    if file is None:
        return None
    table = read_table(file)
    rows: list[Mapping[str, str]] = [
        dict(zip(table.columns, cells, strict=False)) for _, cells in table.rows(LeftOut())
    ]
    try:
        starts = sorted(
            (float(row["experiment time"]), float(row["system time"])) for row in rows if row["event"] == "START"
        )
        if any(not 0.0 <= utc_s < UTC_S[1] for _, utc_s in starts):
            raise ValueError(f"it began at {starts[0][1]:.10g} s")
    except (KeyError, ValueError) as error:
        raise ImportingError(f"{file.name} holds no times of the experiment: leave it out, or export again") from error
    return (np.array([start[0] for start in starts]), np.array([start[1] for start in starts])) if starts else None

"""Messages that the app phyphox posts for the experiment of `phyphox_experiment`.

{"time": {"now": s, "events": [{"event": "START", "experimentTime": 0.0, "systemTime": s}, ...]},
"gyroscope_t": [0.01, ...], "gyroscope_x": [...], ...}: the readings since the last message as one array per column, and
when the experiment was started and paused. A column `_t` is experiment time: seconds that stand still during a pause.
`systemTime` is UTC. A value that is not finite is null.
https://phyphox.org/wiki/index.php/Network_Connections, and the sources of phyphox-android (NetworkService.java,
ExperimentTimeReference.java) and of phyphox-ios (the same names) for the names within `time`.

Both platforms give the specific force, which at rest with the screen up is (0, 0, +9.81) m/s², rad/s and µT: on an
iPhone, phyphox multiplies what the system reports by -9.81 (ExperimentSensorInput.swift). Pressures are in hPa.
"""

import json
import math
from bisect import bisect_right
from collections.abc import Mapping
from typing import Any, NamedTuple

from dropanchor_schemas.wire import MAX_T_NS, PressureSample
from dropanchor_service.phones.phyphox_experiment import AXES, COLUMNS, PRESSURE
from dropanchor_tag_client.sources.phones.readings import PhoneError, is_measurement
from dropanchor_tag_client.sources.phones.streams import Reading, Stream, make_stream

_PA_PER_HPA = 100.0
MAX_S = MAX_T_NS // 1_000_000_000
NO_EXPERIMENT = "The message is not one of the experiment that this service makes for phyphox: load it again."

_Start = tuple[float, float]
"""Experiment time and UTC at which the experiment began or went on, s."""


class Message(NamedTuple):
    """One batch. start_ns: UTC at which the experiment began. streams: by sensor. damaged: readings that make no
    sense."""

    start_ns: int
    streams: Mapping[str, Stream]
    damaged: int
    battery_fraction: None = None
    pressures: tuple[PressureSample, ...] = ()

    @property
    def session_id(self) -> str:
        """The start is all that tells one experiment from the next."""
        return str(self.start_ns)


def parse(body: bytes) -> Message | None:
    """Parse a message. Return None where it has no readings, as while the experiment pauses. Raises PhoneError."""
    try:
        message = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise PhoneError(f"The message is not JSON. {NO_EXPERIMENT}") from error
    if not isinstance(message, dict) or not isinstance(message.get("time"), dict):
        raise PhoneError(NO_EXPERIMENT)
    columns = {name: [_column(message, f"{column}_{axis}") for axis in AXES] for name, column in COLUMNS.items()}
    air = [_column(message, name) for name in PRESSURE]
    if not any(column for columns_of in (*columns.values(), air) for column in columns_of):
        return None
    starts = _starts(message["time"])
    streams, damaged = {}, 0
    for name, columns_of in columns.items():
        streams[name], useless = _stream(columns_of, starts)
        damaged += useless
    used = {name: stream for name, stream in streams.items() if len(stream)}
    pressures, useless = _pressures(air, starts)
    return Message(_utc_ns(0.0, starts), used, damaged + useless, pressures=pressures)


def _column(message: dict[str, Any], name: str) -> list[Any]:
    found = message.get(name, [])
    if not isinstance(found, list):
        raise PhoneError(f"The field {name} is not a list of numbers. {NO_EXPERIMENT}")
    return found


def _starts(time: dict[str, Any]) -> list[_Start]:
    """Return when the experiment began and went on, in order. Raises PhoneError where it never began."""
    events = time.get("events")
    starts = []
    for event in events if isinstance(events, list) else []:
        if isinstance(event, dict) and event.get("event") == "START":
            experiment_s, utc_s = _number(event.get("experimentTime")), _number(event.get("systemTime"))
            if not (0.0 <= experiment_s < MAX_S and 0.0 <= utc_s < MAX_S):
                raise PhoneError(f"An event of the field time has no time. {NO_EXPERIMENT}")
            starts.append((experiment_s, utc_s))
    if not starts:
        raise PhoneError(f"The field time names no start of the experiment. {NO_EXPERIMENT}")
    return sorted(starts)


def _stream(columns: list[list[Any]], starts: list[_Start]) -> tuple[Stream, int]:
    """Return the readings of four columns, and how many make no sense. What lacks a value makes none."""
    readings: list[Reading] = []
    for t_s, x, y, z in zip(*(map(_number, column) for column in columns), strict=False):
        if is_measurement(x, y, z) and 0.0 <= t_s < MAX_S:
            readings.append((_utc_ns(t_s, starts), (x, y, z)))
    return make_stream(readings), max(map(len, columns)) - len(readings)


def _pressures(columns: list[list[Any]], starts: list[_Start]) -> tuple[tuple[PressureSample, ...], int]:
    """Return the pressures, and how many make no sense."""
    readings = tuple(
        PressureSample(_utc_ns(t_s, starts), _PA_PER_HPA * hpa)
        for t_s, hpa in zip(*(map(_number, column) for column in columns), strict=False)
        if math.isfinite(hpa) and 0.0 <= t_s < MAX_S
    )
    return readings, max(map(len, columns)) - len(readings)


def _utc_ns(experiment_s: float, starts: list[_Start]) -> int:
    """Return UTC of an experiment time, by the last start before it."""
    began_s, utc_s = starts[max(0, bisect_right(starts, (experiment_s, math.inf)) - 1)]
    return round(utc_s * 1e6) * 1000 + round((experiment_s - began_s) * 1e9)  # as floats, both hold no more digits


def _number(value: Any) -> float:
    """Return a number of JSON, NaN for anything else."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan

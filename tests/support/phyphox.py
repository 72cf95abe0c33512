"""What the app phyphox posts for the service's experiment, in the form of its sources."""

import json
from collections.abc import Callable, Iterator
from typing import Any

from support.sensor_logger import Vector

S = 1_000_000_000
AXES = ("x", "y", "z")
Value = Callable[[float], Vector]
"""A sensor's reading at an experiment time in s."""


def event(name: str, experiment_s: float, utc_s: float) -> dict[str, Any]:
    return {"event": name, "experimentTime": experiment_s, "systemTime": utc_s}


def message(events: list[dict[str, Any]], now_s: float, readings: dict[str, list[tuple[float, Vector]]]) -> bytes:
    """Return one message. readings: experiment time and values of each sensor."""
    columns: dict[str, list[float]] = {}
    for sensor, rows in readings.items():
        columns[f"{sensor}_t"] = [t for t, _ in rows]
        for index, axis in enumerate(AXES):
            columns[f"{sensor}_{axis}"] = [values[index] for _, values in rows]
    return json.dumps({"time": {"now": now_s, "events": events}} | columns).encode()


def recording(
    seconds: float, sensors: dict[str, Value], start_s: float, rate_hz: int = 100, interval_s: float = 0.2
) -> Iterator[bytes]:
    """Yield the messages of an experiment without a pause. The sensors have times of their own, some ms apart."""
    events, each = [event("START", 0.0, start_s)], round(interval_s * rate_hz)
    for number in range(round(seconds / interval_s)):
        readings = {
            name: [
                (t, value(t))
                for index in range(number * each, (number + 1) * each)
                if (t := (index + 1) / rate_hz - 0.0021 * offset) > 0
            ]
            for offset, (name, value) in enumerate(sensors.items())
        }
        yield message(events, start_s + (number + 1) * interval_s, readings)

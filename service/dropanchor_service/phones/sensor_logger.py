"""Messages that the app Sensor Logger pushes.

{"messageId": 0, "sessionId": "…", "deviceId": "…", "payload": [{"name": "gyroscope", "time": 1698501144401773000,
"values": {"x": 0.1, "y": 0.0, "z": 0.0}}, …]}: the readings of one batch period of all sensors that are switched on,
with UTC in ns. https://github.com/tszheichoi/awesome-sensor-logger/blob/main/PUSHING.md
"""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from dropanchor_schemas.wire import MAX_T_NS
from dropanchor_service.phones.readings import SENSORS, PhoneError, is_measurement
from dropanchor_service.phones.streams import Stream, make_stream

BATTERY = "battery"
MAX_SESSION_ID = 128
MAX_MESSAGE_ID = 2**53


class Message(NamedTuple):
    """One batch. streams: by sensor, those of SENSORS that it has. damaged: readings of them that make no sense.
    battery_fraction: the last charge of the battery in the batch; 1 is full."""

    session_id: str
    message_id: int
    streams: Mapping[str, Stream]
    damaged: int
    battery_fraction: float | None = None


def parse(body: bytes) -> Message | None:
    """Parse a pushed message. Return None where it has no payload: a test of the connection. Raises PhoneError."""
    try:
        message = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise PhoneError("The message is not JSON: is the app Sensor Logger, with HTTP Push?") from error
    if not isinstance(message, dict):
        raise PhoneError("The message is not a JSON object: is the app Sensor Logger, with HTTP Push?")
    payload = message.get("payload", [])
    if not isinstance(payload, list):
        raise PhoneError("The field payload is not a list of readings.")
    if not payload:
        return None
    streams, damaged = _streams(payload)
    return Message(_session_id(message), _message_id(message), streams, damaged, _battery_fraction(payload))


def _session_id(message: dict[str, Any]) -> str:
    found = message.get("sessionId")
    if not isinstance(found, str) or not 0 < len(found) <= MAX_SESSION_ID:
        raise PhoneError(f"The field sessionId is not a text of 1 to {MAX_SESSION_ID} characters.")
    return found


def _message_id(message: dict[str, Any]) -> int:
    found = message.get("messageId")
    if not isinstance(found, int) or isinstance(found, bool) or not 0 <= found < MAX_MESSAGE_ID:
        raise PhoneError("The field messageId is not a number that counts the messages.")
    return found


def _streams(payload: list[Any]) -> tuple[dict[str, Stream], int]:
    """Return the readings by sensor, and how many make no sense. Other sensors are left out."""
    found: dict[str, list[tuple[int, tuple[float, float, float]]]] = {}
    damaged = 0
    for reading in payload:
        name = str(reading.get("name", "")).lower() if isinstance(reading, dict) else ""
        if name not in SENSORS:
            continue
        try:
            found.setdefault(name, []).append((_time(reading["time"]), _vector(reading.get("values", reading))))
        except (KeyError, TypeError, ValueError, OverflowError):
            damaged += 1
    return {name: _stream(readings) for name, readings in found.items() if readings}, damaged


def _stream(readings: list[tuple[int, tuple[float, float, float]]]) -> Stream:
    times, values = zip(*readings, strict=True)
    return make_stream(np.array(times, np.int64), np.array(values, np.float64))


def _time(value: Any) -> int:
    """Return ns. The app has sent numbers and text. Raises ValueError or TypeError."""
    t_ns = int(value)
    if isinstance(value, bool) or not 0 <= t_ns < MAX_T_NS:
        raise ValueError("no time")
    return t_ns


def _vector(values: Any) -> tuple[float, float, float]:
    """Raises KeyError, ValueError or TypeError."""
    x, y, z = float(values["x"]), float(values["y"]), float(values["z"])
    if not is_measurement(x, y, z):
        raise ValueError("no measurement")
    return x, y, z


def _battery_fraction(payload: list[Any]) -> float | None:
    """Return the last charge of the phone's battery in a batch, None without one. -1: the phone does not know it."""
    for reading in reversed(payload):
        values = reading.get("values") if isinstance(reading, dict) and reading.get("name") == BATTERY else None
        level = values.get("batteryLevel") if isinstance(values, dict) else None
        if isinstance(level, int | float) and not isinstance(level, bool) and 0.0 <= level <= 1.0:
            return float(level)
    return None

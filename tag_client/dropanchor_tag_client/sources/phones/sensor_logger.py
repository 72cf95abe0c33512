"""Messages that the app Sensor Logger pushes, over HTTP or MQTT.

{"messageId": 0, "sessionId": "…", "deviceId": "…", "payload": [{"name": "gyroscope", "time": 1698501144401773000,
"values": {"x": 0.1, "y": 0.0, "z": 0.0}}, …]}: the readings of one batch period of all sensors that are switched on,
with UTC in ns. https://github.com/tszheichoi/awesome-sensor-logger/blob/main/PUSHING.md
A barometer's values are its `pressure` in mbar and a relative altitude (UNITS.md beside it).
"""

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import Any, NamedTuple

from dropanchor_schemas.wire import MAX_T_NS, PressureSample, Vector
from dropanchor_tag_client.sources.phones.readings import SENSORS, PhoneError, is_measurement
from dropanchor_tag_client.sources.phones.streams import Reading, Stream, make_stream

BATTERY, BAROMETER = "battery", "barometer"
PA_PER_MBAR = 100.0
MAX_SESSION_ID = 128
MAX_MESSAGE_ID = 2**53
_FIELDS = {"messageId", "sessionId", "deviceId", "payload"}
_NOT_NUMBERS, _TOO_LARGE = "are not numbers", "are larger than a sensor can measure"


class Message(NamedTuple):
    """One batch. streams: by sensor, those of SENSORS that it has. damage: by sensor, what is wrong with readings of it
    that make no sense. damaged: how many these are. battery_fraction: the last charge of the battery in the batch; 1 is
    full. device_id: empty without one. pressures: of the barometer."""

    session_id: str
    message_id: int
    streams: Mapping[str, Stream]
    damaged: int
    battery_fraction: float | None = None
    damage: Mapping[str, str] = MappingProxyType({})
    device_id: str = ""
    pressures: tuple[PressureSample, ...] = ()


class _DamagedError(ValueError):
    """The reading makes no sense. The text goes on after "the readings of a sensor"."""


def parse(body: bytes) -> Message | None:
    """Parse a pushed message. Return None where it has no payload: a test of the connection. Raises PhoneError."""
    try:
        message = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise PhoneError("The message is not JSON: is the app Sensor Logger?") from error
    if not isinstance(message, dict):
        raise PhoneError("The message is not a JSON object: is the app Sensor Logger?")
    payload = message.get("payload", [])
    if not isinstance(payload, list):
        raise PhoneError("The field payload is not a list of readings.")
    if message and not _FIELDS & message.keys():
        names = ", ".join(map(str, list(message)[:4]))
        raise PhoneError(f"The message has fields such as {names}, which are not those of the app Sensor Logger.")
    if not payload:
        return None
    device_id = message.get("deviceId")
    streams, damage, damaged = _streams(payload)
    pressures = tuple(_pressures(payload))
    return Message(
        _session_id(message),
        _message_id(message),
        streams,
        damaged,
        _battery_fraction(payload),
        damage,
        device_id if isinstance(device_id, str) else "",
        pressures,
    )


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


def _streams(payload: list[Any]) -> tuple[dict[str, Stream], dict[str, str], int]:
    """Return the readings by sensor, what is wrong with others, and how many these are. Other sensors are left out."""
    found: dict[str, list[Reading]] = {}
    damage: dict[str, str] = {}
    damaged = 0
    for reading in payload:
        name = str(reading.get("name", "")).lower() if isinstance(reading, dict) else ""
        if name not in SENSORS:
            continue
        try:
            found.setdefault(name, []).append((_time(reading.get("time")), _vector(reading.get("values", reading))))
        except _DamagedError as error:
            damage[name] = str(error)
            damaged += 1
    return {name: make_stream(readings) for name, readings in found.items() if readings}, damage, damaged


def _time(value: Any) -> int:
    """Return ns. The app has sent numbers and text. Raises _DamagedError."""
    try:
        t_ns = int(value)
    except (TypeError, ValueError, OverflowError):
        t_ns = -1
    if isinstance(value, bool) or not 0 <= t_ns < MAX_T_NS:
        raise _DamagedError("have no time")
    return t_ns


def _vector(values: Any) -> Vector:
    """Raises _DamagedError."""
    try:
        x, y, z = float(values["x"]), float(values["y"]), float(values["z"])
    except (KeyError, TypeError, ValueError, OverflowError):
        raise _DamagedError(_NOT_NUMBERS) from None
    if not is_measurement(x, y, z):
        raise _DamagedError(_TOO_LARGE if all(map(math.isfinite, (x, y, z))) else _NOT_NUMBERS)
    return x, y, z


def _pressures(payload: list[Any]) -> Iterator[PressureSample]:
    """Yield the readings of the barometer that are numbers with a time."""
    for reading in payload:
        if not isinstance(reading, dict) or str(reading.get("name", "")).lower() != BAROMETER:
            continue
        values = reading.get("values")
        pressure = values.get("pressure") if isinstance(values, dict) else None
        with suppress(_DamagedError):
            if isinstance(pressure, int | float) and not isinstance(pressure, bool) and math.isfinite(pressure):
                yield PressureSample(_time(reading.get("time")), PA_PER_MBAR * pressure)


def _battery_fraction(payload: list[Any]) -> float | None:
    """Return the last charge of the phone's battery in a batch, None without one. -1: the phone does not know it."""
    for reading in reversed(payload):
        values = reading.get("values") if isinstance(reading, dict) and reading.get("name") == BATTERY else None
        level = values.get("batteryLevel") if isinstance(values, dict) else None
        if isinstance(level, int | float) and not isinstance(level, bool) and 0.0 <= level <= 1.0:
            return float(level)
    return None

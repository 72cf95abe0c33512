"""What the app Sensor Logger pushes, in its documented form."""

import json
from collections.abc import Callable, Iterator
from typing import Any

T_NS = 1_800_000_000_000_000_000
G = 9.80665
Vector = tuple[float, float, float]
Value = Callable[[int], Vector]
"""A sensor's reading at a time in ns."""


def reading(name: str, t_ns: int, xyz: Vector) -> dict[str, Any]:
    return {"name": name, "time": t_ns, "values": dict(zip("xyz", xyz, strict=True)), "accuracy": 3}


def message(message_id: int, readings: list[Any], session: str = "recording-1") -> bytes:
    return json.dumps(
        {"messageId": message_id, "sessionId": session, "deviceId": "phone", "payload": readings}
    ).encode()


def recording(
    seconds: int, sensors: dict[str, Value], rate_hz: int = 100, start_ns: int = T_NS, batch_ns: int = 1_000_000_000
) -> Iterator[bytes]:
    """Messages of one batch period each. The sensors have times of their own, some ms apart."""
    step_ns = 1_000_000_000 // rate_hz
    for number in range(seconds * 1_000_000_000 // batch_ns):
        readings = []
        for offset, (name, value) in enumerate(sensors.items()):
            for index in range(batch_ns // step_ns):
                t_ns = start_ns + number * batch_ns + index * step_ns - offset * 3_100_000
                readings.append(reading(name, t_ns, value(t_ns)))
        yield message(number, readings)

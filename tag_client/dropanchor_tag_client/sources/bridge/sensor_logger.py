"""Messages of the app Sensor Logger, which publishes the readings of a phone's sensors.

{"messageId": 0, "sessionId": "…", "deviceId": "…", "payload": [{"name": "gyroscope", "time": 1698501144401773000,
"values": {"x": 0.1, "y": 0.0, "z": 0.0}}, …]}: the readings of one batch period, with UTC in ns. "Standardise Units &
Frames" must be on, or the phone an Android: then accelerations are specific force. An IMU sample has the time of a
gyroscope reading; the other sensors are interpolated there.
"""

import math
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Iterator
from typing import Any, NamedTuple

from dropanchor_schemas.wire import Vector
from dropanchor_tag_client.sources.bridge.measurement import Drop, Dropped, Measurement, json_of

TOTAL, LINEAR, GRAVITY = "totalacceleration", "accelerometer", "gravity"
GYROSCOPE, MAGNETOMETER = "gyroscope", "magnetometer"
_SENSORS = (TOTAL, LINEAR, GRAVITY, GYROSCOPE, MAGNETOMETER)
_MAX_GAP_NS = 250_000_000  # between two readings that are interpolated
_HOLD_NS = 2_000_000_000  # for which a reading waits for those of the other sensors
_MAX_READINGS = 5_000
_MAX_RECORDINGS = 256


class _Reading(NamedTuple):
    t_ns: int
    value: Vector


class SensorLogger:
    """topic: the one that is set in the app. A `+` in it stands for the tag; without one, the phone's device id does.

    The top edge of the phone points forward.
    """

    def __init__(self, topic: str) -> None:
        self.topics: tuple[str, ...] = (topic,)
        self._tag_level = topic.split("/").index("+") if "+" in topic.split("/") else None
        self._recordings: OrderedDict[tuple[str, str], _Recording] = OrderedDict()

    def parse(self, topic: str, payload: bytes, t_ns: int) -> Iterator[Measurement | Dropped]:  # noqa: ARG002
        message = json_of(payload)
        if isinstance(message, Dropped):
            yield message
            return
        if not isinstance(message, dict) or not isinstance(message.get("payload", []), list):
            yield Dropped(Drop.NOT_UNDERSTOOD, "a message of Sensor Logger was expected: an object with a payload")
            return
        tag = message.get("deviceId") if self._tag_level is None else topic.split("/")[self._tag_level]
        if not isinstance(tag, str) or not tag:
            yield Dropped(Drop.TAG_INVALID, "the message has no deviceId")
            return
        recording = self._recording(tag, str(message.get("sessionId")))
        for found in recording.add(message.get("messageId"), message.get("payload", [])):
            yield Measurement(tag, "imu", found) if isinstance(found, dict) else found
        if (level := _battery_level(message.get("payload", []))) is not None:
            yield Measurement(tag, "health", {"battery_fraction": level})

    def _recording(self, tag: str, session_id: str) -> "_Recording":
        recording = self._recordings.pop((tag, session_id), None) or _Recording()
        self._recordings[tag, session_id] = recording
        if len(self._recordings) > _MAX_RECORDINGS:
            self._recordings.popitem(last=False)
        return recording


class _Recording:
    """The readings of one recording that may still be needed, by sensor."""

    def __init__(self) -> None:
        self._readings: dict[str, list[_Reading]] = {}
        self._last_id = -1

    def add(self, message_id: Any, payload: list[Any]) -> Iterator[dict[str, Any] | Dropped]:
        """Yield the fields of the samples that are complete with this message."""
        if isinstance(message_id, int):
            if message_id == self._last_id:
                yield Dropped(Drop.DUPLICATE, f"message {message_id}")
                return
            self._last_id = message_id
        bad = sum(not self._take(reading) for reading in payload)
        if bad:
            yield Dropped(Drop.NOT_UNDERSTOOD, f"{bad} readings make no sense")
        yield from self._samples()

    def _take(self, reading: Any) -> bool:
        """Keep a reading of a sensor that is used. Return False if it makes no sense."""
        if not isinstance(reading, dict):
            return False
        name = str(reading.get("name")).lower()
        if name not in _SENSORS:
            return True
        try:
            values = reading.get("values", reading)
            x, y, z = (float(values[axis]) for axis in "xyz")
            found = _Reading(int(reading["time"]), (y, -x, z))  # from the phone's axes to those of the tag
        except (KeyError, TypeError, ValueError, OverflowError):
            return False
        if not all(map(math.isfinite, found.value)):
            return False
        kept = self._readings.setdefault(name, [])
        kept.append(found)
        if len(kept) > 1 and found.t_ns < kept[-2].t_ns:
            kept.sort()
        del kept[:-_MAX_READINGS]
        return True

    def _samples(self) -> Iterator[dict[str, Any] | Dropped]:
        parts = (TOTAL,) if TOTAL in self._readings else (LINEAR, GRAVITY)
        gyro = self._readings.get(GYROSCOPE, [])
        newest_ns = max((readings[-1].t_ns for readings in self._readings.values() if readings), default=0)
        unpaired = 0
        while gyro:
            t_ns = gyro[0].t_ns
            is_late = t_ns < newest_ns - _HOLD_NS
            if not is_late and any(t_ns > self._newest_ns(name) for name in (*parts, *self._optional())):
                break
            turn = gyro.pop(0)
            values = [self._at(name, t_ns) for name in parts]
            if None in values:
                unpaired += 1
                continue
            force = [sum(components) for components in zip(*(v for v in values if v), strict=True)]
            yield {"acc": force, "gyro": list(turn.value), "mag": self._at(MAGNETOMETER, t_ns), "t_ns": t_ns}
        if unpaired:
            yield Dropped(Drop.UNPAIRED, "switch on Gyroscope and Total Acceleration, or Accelerometer and Gravity")
        self._forget(newest_ns - 2 * _HOLD_NS)

    def _optional(self) -> tuple[str, ...]:
        return (MAGNETOMETER,) if MAGNETOMETER in self._readings else ()

    def _newest_ns(self, name: str) -> int:
        readings = self._readings.get(name)
        return readings[-1].t_ns if readings else -1

    def _at(self, name: str, t_ns: int) -> list[float] | None:
        """Interpolate a sensor at a time. Return None without readings on both sides that are near enough."""
        readings = self._readings.get(name, [])
        after = bisect_left(readings, t_ns, key=lambda reading: reading.t_ns)
        if after == len(readings) or (after == 0 and readings[0].t_ns != t_ns):
            return None
        right = readings[after]
        if right.t_ns == t_ns:
            return list(right.value)
        left = readings[after - 1]
        gap_ns = right.t_ns - left.t_ns
        share = (t_ns - left.t_ns) / gap_ns
        if gap_ns > _MAX_GAP_NS:
            return None
        return [a + share * (b - a) for a, b in zip(left.value, right.value, strict=True)]

    def _forget(self, before_ns: int) -> None:
        for name, readings in self._readings.items():
            if name != GYROSCOPE and readings and readings[0].t_ns < before_ns:
                del readings[: bisect_left(readings, before_ns, key=lambda reading: reading.t_ns)]


def _battery_level(payload: list[Any]) -> float | None:
    """Return the last charge of the phone's battery in a message, None if there is none."""
    for reading in reversed(payload):
        values = reading.get("values") if isinstance(reading, dict) and reading.get("name") == "battery" else None
        level = values.get("batteryLevel") if isinstance(values, dict) else None
        if isinstance(level, int | float) and not isinstance(level, bool):
            return float(level)
    return None

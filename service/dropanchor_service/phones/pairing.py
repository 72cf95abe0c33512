"""IMU samples of a phone from the readings of its sensors, which each have times of their own.

A sample has the time of a gyroscope reading; the other sensors are interpolated there. Readings that still lack their
neighbour wait for the next batch.

Phone: x right, y to the top edge, z out of the screen. Tag: x forward, y left, z up. The top edge is forward.

Android reports specific force: at rest, screen up, gravity is (0, 0, +9.81). iOS reports its negative, unless
"Standardise Units & Frames" is on. Total acceleration exists on Android only; otherwise gravity tells, while the screen
is up. https://github.com/tszheichoi/awesome-sensor-logger/blob/main/CROSSPLATFORM.md
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.wire import ImuSample, Vector
from dropanchor_service.phones.readings import GRAVITY, GYROSCOPE, LINEAR, MAGNETOMETER, TOTAL
from dropanchor_service.phones.streams import Array, Stream, no_readings

MAX_GAP_NS = 250_000_000  # between two readings that are interpolated
HOLD_NS = 2_000_000_000  # for which a reading waits for its neighbour, and for which readings are kept
MAGNETOMETER_HOLD_NS = 500_000_000
MAX_READINGS = 20_000  # of one sensor that are kept
FLAT_MPS2 = 7.0  # of gravity along z while the phone lies flat
PATIENCE = 3  # batches without any sample before the person is told

LACKING = (
    "No motion can be used yet: switch on Gyroscope, and Total Acceleration (Android) or Accelerometer and Gravity "
    "(iPhone)."
)
TILTED = (
    "Lay the phone flat with its screen up until this message goes away: the service must see which way gravity "
    "points. Or add signs=ios or signs=android to the Push URL."
)


class Signs(StrEnum):
    """Which way accelerations point."""

    AUTO = "auto"
    ANDROID = "android"
    IOS = "ios"


class Paired(NamedTuple):
    """unpaired: gyroscope readings that were given up. problem: a sentence for the person, empty without one."""

    samples: list[ImuSample]
    unpaired: int = 0
    problem: str = ""


class Pairing:
    """Of one recording; batches come in their order."""

    def __init__(self, signs: Signs) -> None:
        self._sign = {Signs.AUTO: 0.0, Signs.ANDROID: 1.0, Signs.IOS: -1.0}[signs]
        self._streams: dict[str, Stream] = {}
        self._none = no_readings()
        self._fruitless = 0

    def beginning_anew(self) -> "Pairing":
        """Return one without readings that knows which way accelerations point."""
        other = Pairing(Signs.AUTO)
        other._sign = self._sign
        return other

    def add(self, batch: Mapping[str, Stream]) -> Paired:
        """Return the samples that are complete with this batch."""
        for name, stream in batch.items():
            self._streams[name] = self._stream(name).merged(stream)
        parts = (TOTAL,) if TOTAL in self._streams else (LINEAR, GRAVITY)
        self._find_sign(parts)
        paired = self._pair(parts)
        self._forget()
        if paired.samples or self._fruitless < 0:
            self._fruitless = -1  # it works: what lacks from now on is a gap
            return paired
        self._fruitless += 1
        if not self._sign and all(len(self._stream(name)) for name in parts):
            return paired._replace(problem=TILTED)
        return paired._replace(problem=LACKING if self._fruitless >= PATIENCE else "")

    def _stream(self, name: str) -> Stream:
        return self._streams.get(name, self._none)

    def _find_sign(self, parts: tuple[str, ...]) -> None:
        """Total acceleration has Android's sign. Gravity tells by the screen, which is up."""
        if parts == (TOTAL,):
            self._sign = 1.0
        if self._sign:
            return
        z = self._stream(GRAVITY).values[:, 2]
        flat = z[np.abs(z) > FLAT_MPS2]
        if len(flat):
            self._sign = float(np.sign(flat[0]))

    def _pair(self, parts: tuple[str, ...]) -> Paired:
        """Take the gyroscope readings that are paired or hopeless out of their stream."""
        gyro = self._stream(GYROSCOPE)
        newest_ns = max(self._stream(name).newest_ns for name in (GYROSCOPE, *parts))
        force, complete = np.zeros((len(gyro), 3)), np.full(len(gyro), self._sign != 0.0)
        decided = np.full(len(gyro), True)
        for name in parts:
            values, usable = self._stream(name).at(gyro.t_ns, MAX_GAP_NS)
            force += self._sign * values
            complete &= usable
            decided &= gyro.t_ns <= self._stream(name).newest_ns
        field, has_field = self._stream(MAGNETOMETER).at(gyro.t_ns, MAX_GAP_NS)
        if newest_ns - self._stream(MAGNETOMETER).newest_ns < MAGNETOMETER_HOLD_NS:
            decided &= gyro.t_ns <= self._stream(MAGNETOMETER).newest_ns
        decided |= gyro.t_ns < newest_ns - HOLD_NS
        used = np.flatnonzero(decided & complete)
        self._streams[GYROSCOPE] = Stream(gyro.t_ns[~decided], gyro.values[~decided])
        samples = [
            ImuSample(
                int(gyro.t_ns[i]), _body(force[i]), _body(gyro.values[i]), _body(field[i]) if has_field[i] else None
            )
            for i in used.tolist()
        ]
        return Paired(samples, int(decided.sum()) - len(used))

    def _forget(self) -> None:
        """Drop readings that no gyroscope reading will need."""
        newest_ns = max(stream.newest_ns for stream in self._streams.values()) if self._streams else 0
        for name, stream in self._streams.items():
            self._streams[name] = stream.since(newest_ns - 2 * HOLD_NS, MAX_READINGS)


def _body(phone: Array) -> Vector:
    """Return a vector of the phone's axes in the tag's."""
    x, y, z = phone.tolist()
    return y, -x, z

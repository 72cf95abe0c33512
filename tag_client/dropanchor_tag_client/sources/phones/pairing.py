"""IMU samples of a phone from the readings of its sensors, which each have times of their own.

A sample has the time of a gyroscope reading; the other sensors are interpolated there. Readings that still lack their
neighbour wait for the next batch.

Phone: x right, y to the top edge, z out of the screen. Tag: x forward, y left, z up. The top edge is forward.

Android reports specific force: at rest, screen up, gravity is (0, 0, +9.81). iOS reports its negative, unless
"Standardise Units & Frames" is on. Total acceleration exists on Android only; otherwise gravity tells, while the screen
is up. https://github.com/tszheichoi/awesome-sensor-logger/blob/main/CROSSPLATFORM.md
"""

from bisect import bisect_right
from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import NamedTuple

from dropanchor_schemas.wire import ImuSample, Vector
from dropanchor_tag_client.sources.phones.problems import APART, TILTED, damaged_in, lacking
from dropanchor_tag_client.sources.phones.readings import GRAVITY, GYROSCOPE, LINEAR, MAGNETOMETER, TOTAL
from dropanchor_tag_client.sources.phones.streams import Stream

MAX_GAP_NS = 250_000_000  # between two readings that are interpolated
HOLD_NS = 2_000_000_000  # for which a reading waits for its neighbour, and for which readings are kept
MAGNETOMETER_HOLD_NS = 500_000_000
MAX_READINGS = 20_000  # of one sensor that are kept
FLAT_MPS2 = 7.0  # of gravity along z while the phone lies flat
PATIENCE = 3  # batches without any sample before the person is told

_NO_DAMAGE: Mapping[str, str] = MappingProxyType({})


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
        self._fruitless = 0
        self._none = Stream([], [])

    def beginning_anew(self) -> "Pairing":
        """Return one without readings that knows which way accelerations point."""
        other = Pairing(Signs.AUTO)
        other._sign = self._sign
        return other

    def add(self, batch: Mapping[str, Stream], damaged: Mapping[str, str] = _NO_DAMAGE) -> Paired:
        """Return the samples that are complete with this batch. damaged: by sensor, what is wrong with readings that
        were left out, such as `are not numbers`."""
        for name, stream in batch.items():
            self._streams[name] = self._stream(name).merged(stream)
        parts = (TOTAL,) if TOTAL in self._streams else (LINEAR, GRAVITY)
        self._find_sign(parts)
        paired = self._pair(parts)
        self._forget()
        if paired.samples:
            self._fruitless = -1
            return paired
        needed = parts if self._streams.keys() >= {*parts} else (TOTAL, LINEAR, GRAVITY)
        wrong = damaged_in((GYROSCOPE, *needed), batch, damaged)
        return paired._replace(problem=wrong or self._problem(parts, paired.unpaired))

    def _problem(self, parts: tuple[str, ...], unpaired: int) -> str:
        """Return why there was no sample yet. Once it works, what lacks is a gap."""
        if self._fruitless < 0:
            return ""
        self._fruitless += 1
        if not self._sign and self._streams.keys() >= {*parts}:
            return TILTED
        if self._fruitless < PATIENCE:
            return ""
        return lacking(self._streams) or (APART if unpaired else "")

    def _stream(self, name: str) -> Stream:
        return self._streams.get(name, self._none)

    def _find_sign(self, parts: tuple[str, ...]) -> None:
        """Total acceleration has Android's sign. Gravity tells by the screen, which is up."""
        if parts == (TOTAL,):
            self._sign = 1.0
        if self._sign:
            return
        flat = (z for _, _, z in self._stream(GRAVITY).values if abs(z) > FLAT_MPS2)
        self._sign = next((1.0 if z > 0 else -1.0 for z in flat), 0.0)

    def _pair(self, parts: tuple[str, ...]) -> Paired:
        """Take the gyroscope readings that are paired or hopeless out of their stream."""
        gyro = self._stream(GYROSCOPE)
        newest_ns = max(self._stream(name).newest_ns for name in (GYROSCOPE, *parts))
        until_ns = max(self._decided_until(parts, newest_ns), newest_ns - HOLD_NS - 1)
        decided = bisect_right(gyro.t_ns, until_ns)
        if decided:
            self._streams[GYROSCOPE] = Stream(gyro.t_ns[decided:], gyro.values[decided:])
        samples = []
        for t_ns, turning in zip(gyro.t_ns[:decided], gyro.values[:decided], strict=True):
            force = self._force(parts, t_ns)
            if force is not None:
                field = self._stream(MAGNETOMETER).at(t_ns, MAX_GAP_NS)
                samples.append(ImuSample(t_ns, force, _body(turning), None if field is None else _body(field)))
        return Paired(samples, decided - len(samples))

    def _decided_until(self, parts: tuple[str, ...], newest_ns: int) -> int:
        """Return the time up to which all sensors that are awaited have readings."""
        awaited = [self._stream(name).newest_ns for name in parts]
        magnetometer_ns = self._stream(MAGNETOMETER).newest_ns
        if newest_ns - magnetometer_ns < MAGNETOMETER_HOLD_NS:
            awaited.append(magnetometer_ns)
        return min(awaited)

    def _force(self, parts: tuple[str, ...], t_ns: int) -> Vector | None:
        """Return the specific force at a time in the axes of the tag, None while it or its sign is unknown."""
        found = [self._stream(name).at(t_ns, MAX_GAP_NS) for name in parts]
        known = [one for one in found if one is not None]
        if not self._sign or len(known) < len(parts):
            return None
        x, y, z = (self._sign * sum(components) for components in zip(*known, strict=True))
        return _body((x, y, z))

    def _forget(self) -> None:
        """Drop readings that no gyroscope reading will need."""
        newest_ns = max((stream.newest_ns for stream in self._streams.values()), default=0)
        for name, stream in self._streams.items():
            self._streams[name] = stream.since(newest_ns - 2 * HOLD_NS, MAX_READINGS)


def _body(phone: Vector) -> Vector:
    """Return a vector of the phone's axes in the tag's."""
    x, y, z = phone
    return y, -x, z

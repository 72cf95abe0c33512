"""IMU chips on I²C, through Adafruit's libraries: accelerations in m/s², rates in rad/s, magnetic fields in µT."""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from enum import StrEnum
from importlib import import_module
from typing import Any, NamedTuple, Protocol

from dropanchor_schemas.wire import Vector
from dropanchor_tag_client.reminders import Reminders

_BNO085_INTERVAL_US = 10_000
_RETRY_S, _MAX_RETRY_S = 0.5, 5.0
_FAILURES = 20  # readings in a row that fail before the chip is opened again
_STUCK_S = 2.0  # after which readings that do not change at all are no measurements
_NO_ANSWER_HINT = "check the wiring, the address (i2cdetect -y 1 lists them) and that I2C is switched on"


class ChipError(ValueError):
    """The chip cannot be used. The message says what to do."""


class Drop(StrEnum):
    """Why a reading was not used."""

    BUS_ERROR = "bus_error"
    NOT_READY = "not_ready"
    STUCK = "stuck"


class Chip(Protocol):
    """What Adafruit's libraries have in common."""

    @property
    def acceleration(self) -> Any: ...

    @property
    def gyro(self) -> Any: ...

    @property
    def magnetic(self) -> Any: ...


class Reading(NamedTuple):
    """A reading in the axes of the chip. mag: None if the chip has no new value."""

    t_ns: int
    acc: Vector
    gyro: Vector
    mag: Vector | None


def _bno055(i2c: Any, address: int | None) -> Chip:
    library = import_module("adafruit_bno055")
    chip: Any = library.BNO055_I2C(i2c, address or 0x28)
    chip.mode = library.AMG_MODE  # the three sensors as they are, without the chip's own fusion and corrections
    return chip  # type: ignore[no-any-return]


def _bno085(i2c: Any, address: int | None) -> Chip:
    library, reports = import_module("adafruit_bno08x.i2c"), import_module("adafruit_bno08x")
    chip: Any = library.BNO08X_I2C(i2c, address=address or 0x4A)
    for report in ("ACCELEROMETER", "GYROSCOPE", "MAGNETOMETER"):
        chip.enable_feature(getattr(reports, f"BNO_REPORT_{report}"), _BNO085_INTERVAL_US)
    return chip  # type: ignore[no-any-return]


def _icm20948(i2c: Any, address: int | None) -> Chip:
    chip: Chip = import_module("adafruit_icm20x").ICM20948(i2c, address or 0x69)
    return chip


CHIPS: dict[str, Callable[[Any, int | None], Chip]] = {"bno055": _bno055, "bno085": _bno085, "icm20948": _icm20948}


def open_chip(device: str, bus: int, address: int | None) -> Chip:
    """Return the chip on an I²C bus of Linux, /dev/i2c-<bus>. Raises ChipError, and ModuleNotFoundError."""
    extended_bus = import_module("adafruit_extended_bus")
    try:
        return CHIPS[device](extended_bus.ExtendedI2C(bus), address)
    except ModuleNotFoundError:
        raise
    except Exception as error:  # the libraries raise many kinds where no chip answers
        raise ChipError(f"{device} on I2C bus {bus} does not answer: {error}; {_NO_ANSWER_HINT}") from error


class Readings:
    """Read a chip at a fixed rate, and open it again when it fails.

    dropped: number of readings that were left out so far, by reason.
    """

    def __init__(self, opened: Callable[[], Chip], rate_hz: float, say: Callable[[str], None]) -> None:
        """opened: opens the chip. say: shows a sentence to a person. Raises ChipError when the chip does not answer."""
        self.dropped: Counter[Drop] = Counter()
        self._opened = opened
        self._period_s = 1.0 / rate_hz
        self._say = say
        self._chip = opened()
        self._last: tuple[Vector, Vector] | None = None
        self._changed_s = time.monotonic()
        self._last_mag: Vector | None = None

    def __iter__(self) -> Iterator[Reading]:
        failures, due_s = 0, time.monotonic()
        while True:
            due_s = max(due_s + self._period_s, time.monotonic() - 1.0)
            time.sleep(max(0.0, due_s - time.monotonic()))
            found = self._read()
            if isinstance(found, Reading):
                failures = 0
                yield found
                continue
            self.dropped[found] += 1
            failures += found is not Drop.STUCK
            if failures >= _FAILURES:
                self._reopen()
                failures, due_s = 0, time.monotonic()

    def _read(self) -> Reading | Drop:
        try:
            begin_ns = time.time_ns()
            acc, gyro = self._chip.acceleration, self._chip.gyro
            t_ns = (begin_ns + time.time_ns()) // 2
            mag = self._chip.magnetic
        except Exception:  # the libraries raise many kinds for a broken packet
            return Drop.BUS_ERROR
        if not _is_vector(acc) or not _is_vector(gyro):
            return Drop.NOT_READY
        return self._judged(t_ns, tuple(acc), tuple(gyro), tuple(mag) if _is_vector(mag) else None)

    def _judged(self, t_ns: int, acc: Vector, gyro: Vector, mag: Vector | None) -> Reading | Drop:
        if (acc, gyro) != self._last:
            self._last, self._changed_s = (acc, gyro), time.monotonic()
        elif time.monotonic() - self._changed_s > _STUCK_S or not any(acc):
            return Drop.STUCK
        is_new = mag != self._last_mag
        self._last_mag = mag
        return Reading(t_ns, acc, gyro, mag if is_new else None)

    def _reopen(self) -> None:
        """Open the chip again until it answers."""
        retry_s, reminders = _RETRY_S, Reminders()
        while True:
            try:
                self._chip = self._opened()
                self._say("the chip answers again")
                return
            except ChipError as error:
                if reminders.failed():
                    self._say(f"{error}. {reminders.words}.")
            time.sleep(retry_s)
            retry_s = min(2 * retry_s, _MAX_RETRY_S)


def _is_vector(values: Any) -> bool:
    return (
        isinstance(values, tuple | list)
        and len(values) == 3
        and all(isinstance(value, int | float) and math.isfinite(value) for value in values)
    )

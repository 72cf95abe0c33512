"""IMU chips with the attributes that Adafruit's libraries document, without a bus."""

import itertools
import sys
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import pytest

from dropanchor_schemas.wire import Vector

Motion = Iterator[tuple[Any, Any, Any]]
"""Acceleration, rate and magnetic field of each reading. An exception in place of an acceleration is raised."""

GRAVITY: Vector = (0.0, 0.0, 9.81)


class FakeChip:
    """Moves on with every reading of the acceleration, as the libraries do. Ends the program after the motion."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion
        self.enabled: list[tuple[int, int]] = []
        self.mode = 12

    @property
    def acceleration(self) -> Any:
        try:
            acc, self._gyro, self._mag = next(self._motion)
        except StopIteration:
            raise KeyboardInterrupt from None
        if isinstance(acc, Exception):
            raise acc
        return acc

    @property
    def gyro(self) -> Any:
        return self._gyro

    @property
    def magnetic(self) -> Any:
        return self._mag

    def enable_feature(self, feature_id: int, report_interval: int = 50_000) -> None:
        self.enabled.append((feature_id, report_interval))


class FakeLibraries:
    """Modules in place of Adafruit's. opened: the arguments with which chips were made, and the chips."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, motion: Callable[[], Motion]) -> None:
        self.opened: list[tuple[str, Any, Any, FakeChip]] = []
        self.absent = False
        self._motion = motion

        def made(name: str) -> Callable[..., FakeChip]:
            def chip(i2c: Any, *args: Any, **options: Any) -> FakeChip:
                if self.absent:
                    raise ValueError("No I2C device at address: 0x28")
                found = FakeChip(self._motion())
                self.opened.append((name, i2c, options.get("address", args[0] if args else None), found))
                return found

            return chip

        contents: dict[str, dict[str, Any]] = {
            "adafruit_extended_bus": {"ExtendedI2C": lambda bus: f"bus {bus}"},
            "adafruit_bno055": {"BNO055_I2C": made("bno055"), "AMG_MODE": 7},
            "adafruit_bno08x": {
                "BNO_REPORT_ACCELEROMETER": 1,
                "BNO_REPORT_GYROSCOPE": 2,
                "BNO_REPORT_MAGNETOMETER": 3,
            },
            "adafruit_bno08x.i2c": {"BNO08X_I2C": made("bno085")},
            "adafruit_icm20x": {"ICM20948": made("icm20948")},
        }
        for name, attributes in contents.items():
            module = ModuleType(name)
            vars(module).update(attributes)
            monkeypatch.setitem(sys.modules, name, module)


def resting(
    count: int, acc: Vector = GRAVITY, gyro: Vector = (0.0, 0.0, 0.0), mag: Vector = (0.0, 20.0, -40.0)
) -> Motion:
    """Yield readings at rest with a little noise, so that no two are equal."""
    for i in itertools.islice(itertools.count(), count):
        noise = 0.001 * (i % 7)
        yield tuple(a + noise for a in acc), tuple(g + noise / 10 for g in gyro), tuple(m + noise for m in mag)

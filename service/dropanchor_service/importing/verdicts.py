"""What the values themselves say about their units and axes, as sentences for the person."""

from collections.abc import Mapping

import numpy as np

from dropanchor_service.importing.join import Imu
from dropanchor_service.importing.readings import ACC, Ranges, Unit

MIN_SAMPLES = 20
_G, _MILLI_G, _NOTHING = (0.85, 1.2), (850.0, 1200.0), 3.0
_GRAVITY_MPS2 = (8.0, 12.0)


def verdicts(imu: Imu, ranges: Ranges, units: Mapping[str, Unit]) -> list[str]:  # noqa: ARG001
    """Return what is wrong with the samples by their values. units: as the source has them, by quantity."""
    if len(imu) < MIN_SAMPLES:
        return []
    return _of_acceleration(float(np.median(np.linalg.norm(imu.acc, axis=1))), units.get(ACC, Unit(None)))


def _of_acceleration(median: float, unit: Unit) -> list[str]:
    """At rest or at a steady speed, an acceleration with gravity is 9.8 m/s²."""
    if _GRAVITY_MPS2[0] <= median <= _GRAVITY_MPS2[1]:
        return []
    for (low, high), name in ((_G, "g"), (_MILLI_G, "mg")):
        if low <= median <= high:
            return [
                f"the accelerations look like {name}: their median is {median:.3g} where {_WANTED}{_advice(unit, name)}"
            ]
    if median < _NOTHING:
        return [
            f"gravity is missing from the accelerations: their median is {median:.3g} m/s² where {_WANTED}. Record the "
            "acceleration with gravity (Android: TYPE_ACCELEROMETER, not TYPE_LINEAR_ACCELERATION)"
        ]
    return [f"the median acceleration is {median:.3g} m/s² where {_WANTED}: is the unit right?"]


_WANTED = "9.8 m/s² is usual"


def _advice(unit: Unit, name: str) -> str:
    """Return which words of `--map` to give, where nobody told a unit."""
    if unit.name is not None or not unit.given:
        return f" (the source says {unit.name})" if unit.name else ""
    return f": --map {' '.join(f'{word}:{name}' for word in unit.given)}"

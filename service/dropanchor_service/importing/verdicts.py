"""What the samples themselves say about their units and axes, as sentences for the person."""

from collections.abc import Mapping

import numpy as np

from dropanchor_service.estimation.columns import IMU, RANGE, SampleBatch
from dropanchor_service.estimation.plausibility.recorded import findings_of
from dropanchor_service.estimation.plausibility.verdicts import Finding
from dropanchor_service.importing.join import Imu
from dropanchor_service.importing.readings import ACC, GYRO, Ranges, Unit
from dropanchor_service.importing.readings import RANGE as OF_RANGE

_MOST_RADPS = 36.0  # the usual range ends at 2000 deg/s
_QUANTITY = {"acc_unit": ACC, "gyro_unit": GYRO, "range_unit": OF_RANGE}


def verdicts(imu: Imu, ranges: Ranges, units: Mapping[str, Unit]) -> list[str]:
    """Return what is wrong with the samples, as the check of a live tag says it. units: as the source has them."""
    found: dict[str, Finding] = {}
    for anchor in sorted(set(ranges.anchors)) or [""]:
        found |= {finding.name: finding for finding in findings_of(_samples(imu, ranges, anchor))}
    return [finding.sentence + _advice(finding, units) for finding in found.values()] + _of_turns(imu, units, found)


def _of_turns(imu: Imu, units: Mapping[str, Unit], found: Mapping[str, Finding]) -> list[str]:
    """Return that turn rates whose unit nobody told are degrees, where no such sensor measures so many radians."""
    unit = units.get(GYRO, Unit(None))
    largest = float(np.abs(imu.gyro).max()) if len(imu) else 0.0
    if unit.name is not None or largest <= _MOST_RADPS or any(_QUANTITY.get(name) == GYRO for name in found):
        return []
    words = " ".join(f"{word}:deg/s" for word in unit.given)
    return [
        f"Turn rates of {largest:.3g} rad/s are more than such a sensor measures: are they deg/s? Here: --map {words}"
    ]


def _samples(imu: Imu, ranges: Ranges, anchor: str) -> SampleBatch:
    """Return the IMU samples and the ranges to one anchor."""
    here = np.array([name == anchor for name in ranges.anchors], bool)
    samples = SampleBatch(np.zeros(len(imu), IMU), np.zeros(int(here.sum()), RANGE))
    samples.imu["t_ns"], samples.imu["acc"] = imu.t_ns, imu.acc
    samples.imu["gyro"], samples.imu["mag"] = imu.gyro, imu.mag
    if here.any():
        samples.ranges["t_ns"], samples.ranges["range"] = ranges.t_ns[here], ranges.range_m[here]
    return samples


def _advice(finding: Finding, units: Mapping[str, Unit]) -> str:
    """Return which words of `--map` to give, where nobody told a unit."""
    name, value = finding.setting or ("", "")
    unit = units.get(_QUANTITY.get(name, ""), Unit(None))
    if unit.name is not None or not unit.given:
        return f" (The source says {unit.name}.)" if unit.name else ""
    return f" Here: --map {' '.join(f'{word}:{value}' for word in unit.given)}"

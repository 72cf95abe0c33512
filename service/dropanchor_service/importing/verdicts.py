"""What the samples themselves say about their units and axes, as sentences for the person."""

from collections.abc import Mapping

import numpy as np

from dropanchor_service.estimation.columns import IMU, RANGE, SampleBatch
from dropanchor_service.estimation.plausibility.recorded import findings_of
from dropanchor_service.estimation.plausibility.verdicts import Finding
from dropanchor_service.importing.join import Imu
from dropanchor_service.importing.readings import ACC, GYRO, Ranges, Unit
from dropanchor_service.importing.readings import RANGE as OF_RANGE

_LEAST_COUNTS = 1_500.0  # m/s²: more than thousandths of g
_MOST_RADPS = 36.0  # the usual range ends at 2000 deg/s
_QUANTITY = {"acc_unit": ACC, "gyro_unit": GYRO, "range_unit": OF_RANGE}


def verdicts(imu: Imu, ranges: Ranges, units: Mapping[str, Unit]) -> list[str]:
    """Return what is wrong with the samples, as the check of a live tag says it. units: as the source has them."""
    found: dict[str, Finding] = {}
    for anchor in sorted(set(ranges.anchors)) or [""]:
        found |= {finding.name: finding for finding in findings_of(_samples(imu, ranges, anchor))}
    return [finding.sentence + _advice(finding, units) for finding in found.values()] + _of_turns(imu, units, found)


def _of_turns(imu: Imu, units: Mapping[str, Unit], found: Mapping[str, Finding]) -> list[str]:
    """Return that values without a unit are counts of the sensor, or that turn rates are degrees, where they are so
    large that no such sensor measures them in m/s² and rad/s."""
    acc, gyro = units.get(ACC, Unit(None)), units.get(GYRO, Unit(None))
    if not len(imu) or gyro.name is not None or any(_QUANTITY.get(name) == GYRO for name in found):
        return []
    largest, force = float(np.abs(imu.gyro).max()), float(np.median(np.linalg.norm(imu.acc, axis=1)))
    if acc.name is None and force > _LEAST_COUNTS:
        words = [*(f"{word}:g/16384" for word in acc.given), *(f"{word}:deg/s/131" for word in gyro.given)]
        said = "The values look like counts of the sensor. With its usual ranges, ±2 g and ±250 deg/s"
        return [f"{said}: --map {' '.join(words)}"]
    if largest <= _MOST_RADPS:
        return []
    words = [f"{word}:deg/s" for word in gyro.given]
    said = f"Turn rates of {largest:.3g} rad/s are more than such a sensor measures: are they deg/s? Here"
    return [f"{said}: --map {' '.join(words)}"]


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

"""Typical field problems, as changes to the sensor models of a tag."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from dropanchor_tag_client.simulator.sensors import SensorModels

Perturbation = Callable[[SensorModels], SensorModels]


def perturbed(models: SensorModels, *names: str) -> SensorModels:
    """Return the sensors with these perturbations, applied in order. Raises ValueError for an unknown name."""
    for name in names:
        if name not in PERTURBATIONS:
            raise ValueError(f"there is no perturbation {name!r}; there are {', '.join(PERTURBATIONS)}")
        models = PERTURBATIONS[name](models)
    return models


def _ranges(**changes: Any) -> Perturbation:
    return lambda models: replace(models, ranges=replace(models.ranges, **changes))


def _heading(**changes: Any) -> Perturbation:
    return lambda models: replace(models, heading_error=replace(models.heading_error, **changes))


def _correlated_heading(models: SensorModels) -> SensorModels:
    error = replace(models.heading_error, correlated_std=0.1, correlation_s=3.0)
    return replace(models, heading_error=error, scalar=replace(models.scalar, heading_std=0.0))


def _drifting_gyro(models: SensorModels) -> SensorModels:
    drift = 0.03
    return replace(models, scalar=replace(models.scalar, gyro_drift=drift), imu=replace(models.imu, gyro_drift=drift))


def _disturbed_field(models: SensorModels) -> SensorModels:
    return replace(models, imu=replace(models.imu, disturbances_per_min=3.0))


def _combination(models: SensorModels) -> SensorModels:
    return perturbed(models, "nlos10", "drop20", "outage5", "hb0.1")


# nlos10: 10 % of the ranges are 0.3 to 2 m too long. nlosburst: four bursts of 1-3 s, each with one excess.
# drop20: 20 % of the ranges are lost. outage5: 5 s without ranges. hb: constant heading error, rad.
# hdrift: sinusoidal heading error of 0.2 rad and 40 s. hcorr: Gauss-Markov heading error of 0.1 rad and 3 s instead of
# white noise, typical of magnetometers. gdrift: sinusoidal gyro bias of 0.03 rad/s and 60 s. magdist: three magnetic
# disturbances of 5 to 30 µT a minute. late15: the first sample arrives 15 s after the motion starts.
PERTURBATIONS: Mapping[str, Perturbation] = MappingProxyType(
    {
        "nlos10": _ranges(nlos_share=0.1),
        "nlosburst": _ranges(burst_count=4),
        "drop20": _ranges(dropout_share=0.2),
        "outage5": _ranges(outage_s=5.0),
        "hb0.1": _heading(bias=0.1),
        "hb0.2": _heading(bias=0.2),
        "hdrift": _heading(drift=0.2, drift_period_s=40.0),
        "hcorr": _correlated_heading,
        "gdrift": _drifting_gyro,
        "magdist": _disturbed_field,
        "late15": lambda models: replace(models, first_seen_s=15.0),
        "combo": _combination,
    }
)

"""Judges the values of samples, all of them at once: every sample that is not used is counted under one reason."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dropanchor_schemas.wire import MAX_T_NS, Reason
from dropanchor_service.decode import Decoded
from dropanchor_service.estimation.batch import Array

# Beyond what such sensors can measure a value is absurd. The widest ranges of consumer IMUs are ±30 g and ±4,000 °/s
# (TDK ICM-20649, DS-000192) and ±4,912 µT (Asahi Kasei AK09916); UWB radios end far below 3 km.
ACC_LIMIT = 320.0  # m/s², each axis
GYRO_LIMIT = 72.0  # rad/s, each axis
MAG_LIMIT = 5_000.0  # µT, each axis
RANGE_LIMIT = 3_000.0  # m
ANGLE_LIMIT = 1_000.0  # rad: headings may be unwrapped, but not without end
RANGE_STD_LIMITS = (1e-3, 100.0)  # m
ANGLE_STD_LIMITS = (1e-4, 2 * np.pi)  # rad

Check = tuple[Reason, Array]


@dataclass(frozen=True)
class Rejected:
    """Samples that were not used; messages: the index of the payload of each."""

    reason: Reason
    messages: Array


def screen(decoded: Decoded) -> tuple[Decoded, list[Rejected]]:
    """The samples whose values a sensor can have measured, and the others by reason."""
    rejected: list[Rejected] = []
    imu = _kept(decoded.imu, decoded.imu["row"], _imu_checks(decoded.imu), rejected)
    scalars = [
        _kept(samples, samples["message"], checks(samples), rejected)
        for samples, checks in (
            (decoded.ranges, _range_checks),
            (decoded.headings, _heading_checks),
            (decoded.bearings, _bearing_checks),
        )
    ]
    ranges, headings, bearings = scalars
    return replace(decoded, imu=imu, ranges=ranges, headings=headings, bearings=bearings), rejected


def within_time(t_ns: Array) -> Array:
    """Which UTC times can be one."""
    inside: Array = (t_ns >= 0) & (t_ns < MAX_T_NS)
    return inside


def keep(samples: Array, messages: Array, bad: Array, reason: Reason, rejected: list[Rejected]) -> Array:
    """The samples that are not `bad`; the others are added to `rejected`."""
    return _kept(samples, messages, [(reason, bad)], rejected)


def _kept(samples: Array, messages: Array, checks: Iterable[Check], rejected: list[Rejected]) -> Array:
    good = np.ones(len(samples), bool)
    for reason, bad in checks:
        found = bad & good
        if found.any():
            rejected.append(Rejected(reason, messages[found]))
            good &= ~found
    return samples if good.all() else samples[good]


def _imu_checks(imu: Array) -> Sequence[Check]:
    no_mag: Array = np.isnan(imu["mag"]).all(axis=1)
    in_field: Array = no_mag | _inside(imu["mag"], MAG_LIMIT)
    small = _inside(imu["acc"], ACC_LIMIT) & _inside(imu["gyro"], GYRO_LIMIT) & in_field
    if small.all():
        return ()
    finite: Array = no_mag | np.isfinite(imu["mag"]).all(axis=1)
    finite &= np.isfinite(imu["acc"]).all(axis=1) & np.isfinite(imu["gyro"]).all(axis=1)
    return (Reason.NOT_FINITE, ~finite), (Reason.IMU_ABSURD, ~small)


def _inside(vectors: Array, limit: float) -> Array:
    """False for NaN too."""
    inside: Array = np.logical_and.reduce(np.abs(vectors) <= limit, axis=1)
    return inside


def _range_checks(ranges: Array) -> Sequence[Check]:
    return (
        (Reason.NOT_FINITE, ~np.isfinite(ranges["value"])),
        (Reason.RANGE_NEGATIVE, ranges["value"] < 0),
        (Reason.RANGE_ABSURD, ranges["value"] > RANGE_LIMIT),
        (Reason.STD_INVALID, _std_is_bad(ranges["std"], RANGE_STD_LIMITS)),
    )


def _heading_checks(headings: Array) -> Sequence[Check]:
    return _angle_checks(headings, Reason.HEADING_ABSURD)


def _bearing_checks(bearings: Array) -> Sequence[Check]:
    return _angle_checks(bearings, Reason.BEARING_ABSURD)


def _angle_checks(angles: Array, absurd: Reason) -> Sequence[Check]:
    return (
        (Reason.NOT_FINITE, ~np.isfinite(angles["value"])),
        (absurd, np.abs(angles["value"]) > ANGLE_LIMIT),
        (Reason.STD_INVALID, _std_is_bad(angles["std"], ANGLE_STD_LIMITS)),
    )


def _std_is_bad(std: Array, limits: tuple[float, float]) -> Array:
    """NaN says that it is unknown, which is not bad."""
    bad: Array = (std < limits[0]) | (std > limits[1])
    return bad

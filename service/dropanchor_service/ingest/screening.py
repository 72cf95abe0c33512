"""Screen the values of samples in bulk. Every sample that is rejected has exactly one reason."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from dropanchor_schemas.wire import MAX_T_NS, Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.decode import Decoded
from dropanchor_service.ingest.kernels import values

RANGE_LIMITS = (0.0, 3_000.0)  # m: UWB radios end far below
ANGLE_LIMITS = (-1_000.0, 1_000.0)  # rad: headings may be unwrapped, but not without end
RANGE_STD_LIMITS = (1e-3, 100.0)  # m
ANGLE_STD_LIMITS = (1e-4, 2 * np.pi)  # rad

_COMMON = {values.NOT_FINITE: Reason.NOT_FINITE, values.STD_INVALID: Reason.STD_INVALID}
_OF_IMU = _COMMON | {values.ABSURD: Reason.IMU_ABSURD}
_OF_RANGES = _COMMON | {values.NEGATIVE: Reason.RANGE_NEGATIVE, values.ABSURD: Reason.RANGE_ABSURD}
_OF_HEADINGS = _COMMON | dict.fromkeys((values.NEGATIVE, values.ABSURD), Reason.HEADING_ABSURD)
_OF_BEARINGS = _COMMON | dict.fromkeys((values.NEGATIVE, values.ABSURD), Reason.BEARING_ABSURD)


@dataclass(frozen=True)
class Rejected:
    """Rejected samples. messages: index of the message of each."""

    reason: Reason
    messages: Array


def screen(decoded: Decoded) -> tuple[Decoded, list[Rejected]]:
    """Return the samples with values that a sensor can have measured, and the others by reason."""
    rejected: list[Rejected] = []
    of_ranges, of_angles = (*RANGE_LIMITS, *RANGE_STD_LIMITS), (*ANGLE_LIMITS, *ANGLE_STD_LIMITS)
    return replace(
        decoded,
        imu=_screened_imu(decoded.imu, rejected),
        ranges=_screened(decoded.ranges, of_ranges, _OF_RANGES, rejected),
        headings=_screened(decoded.headings, of_angles, _OF_HEADINGS, rejected),
        bearings=_screened(decoded.bearings, of_angles, _OF_BEARINGS, rejected),
    ), rejected


def keep(samples: Array, bad: Array, reason: Reason, rejected: list[Rejected]) -> Array:
    """Return the samples that are not `bad`, and add the others to `rejected`."""
    if not bad.any():
        return samples
    rejected.append(Rejected(reason, samples["message"][bad]))
    return samples[~bad]


def _screened_imu(imu: Array, rejected: list[Rejected]) -> Array:
    verdicts = np.empty(len(imu), np.uint8)
    if not len(imu) or not values.judge_imu(imu, verdicts):
        return imu
    return _good(imu, verdicts, _OF_IMU, rejected)


def _screened(
    samples: Array, limits: tuple[float, float, float, float], reasons: Mapping[int, Reason], rejected: list[Rejected]
) -> Array:
    verdicts = np.empty(len(samples), np.uint8)
    if not len(samples) or not values.judge_scalars(samples["value"], samples["std"], *limits, verdicts):
        return samples
    return _good(samples, verdicts, reasons, rejected)


def _good(samples: Array, verdicts: Array, reasons: Mapping[int, Reason], rejected: list[Rejected]) -> Array:
    for verdict in np.unique(verdicts[verdicts != values.GOOD]).tolist():
        rejected.append(Rejected(reasons[verdict], samples["message"][verdicts == verdict]))
    good: Array = samples[verdicts == values.GOOD]
    return good


def within_time(t_ns: Array) -> Array:
    """Return which times lie in the range of valid UTC times."""
    inside: Array = (t_ns >= 0) & (t_ns < MAX_T_NS)
    return inside

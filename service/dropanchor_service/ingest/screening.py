"""Screen the values of samples in bulk. Every sample that is rejected has exactly one reason."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dropanchor_schemas.kinds import IMU, SCALARS
from dropanchor_schemas.wire import MAX_T_NS, Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.decode import Decoded
from dropanchor_service.ingest.kernels import values

_OF_IMU = {values.NOT_FINITE: Reason.NOT_FINITE, values.ABSURD: Reason.IMU_ABSURD}
_OF_SCALARS = [
    {
        values.NOT_FINITE: Reason.NOT_FINITE,
        values.NEGATIVE: kind.below,
        values.ABSURD: kind.above,
        values.STD_INVALID: kind.second_outside,
    }
    for kind in SCALARS
]


@dataclass(frozen=True)
class Rejected:
    """Rejected samples of one kind. messages: index of the message of each."""

    reason: Reason
    kind: str
    messages: Array


def screen(decoded: Decoded) -> tuple[Decoded, list[Rejected]]:
    """Return the samples with values that a sensor can have measured, and the others by reason."""
    rejected: list[Rejected] = []
    imu, *scalars = decoded.columns()
    columns = [_screened_imu(imu, rejected)]
    for kind, reasons, column in zip(SCALARS, _OF_SCALARS, scalars, strict=True):
        columns.append(_screened(column, (*kind.limits, *kind.second_limits), reasons, kind.name, rejected))
    return (decoded.with_columns(columns) if rejected else decoded), rejected


def absurd_imu(imu: Array) -> tuple[Array, Array]:
    """Return the IMU samples beyond what sensors measure, and the greatest value of each."""
    sizes = np.abs(np.concatenate([imu["acc"], imu["gyro"]], axis=1))
    beyond = (sizes[:, :3] > values.ACC_LIMIT).any(axis=1) | (sizes[:, 3:] > values.GYRO_LIMIT).any(axis=1)
    return imu[beyond], sizes[beyond].max(axis=1, initial=0.0)


def keep(samples: Array, bad: Array, reason: Reason, kind: str, rejected: list[Rejected]) -> Array:
    """Return the samples that are not `bad`, and add the others to `rejected`."""
    if not bad.any():
        return samples
    rejected.append(Rejected(reason, kind, samples["message"][bad]))
    return samples[~bad]


def _screened_imu(imu: Array, rejected: list[Rejected]) -> Array:
    verdicts = np.empty(len(imu), np.uint8)
    if not len(imu) or not values.judge_imu(imu, verdicts):
        return imu
    return _good(imu, verdicts, _OF_IMU, IMU.name, rejected)


def _screened(
    samples: Array,
    limits: tuple[float, float, float, float],
    reasons: Mapping[int, Reason],
    kind: str,
    rejected: list[Rejected],
) -> Array:
    verdicts = np.empty(len(samples), np.uint8)
    if not len(samples) or not values.judge_scalars(samples["value"], samples["std"], *limits, verdicts):
        return samples
    return _good(samples, verdicts, reasons, kind, rejected)


def _good(samples: Array, verdicts: Array, reasons: Mapping[int, Reason], kind: str, rejected: list[Rejected]) -> Array:
    for verdict in np.unique(verdicts[verdicts != values.GOOD]).tolist():
        rejected.append(Rejected(reasons[verdict], kind, samples["message"][verdicts == verdict]))
    good: Array = samples[verdicts == values.GOOD]
    return good


def within_time(t_ns: Array) -> Array:
    """Return which times lie in the range of valid UTC times."""
    inside: Array = (t_ns >= 0) & (t_ns < MAX_T_NS)
    return inside

"""What a user's device may do that the simulator's own sensors do not: each is named in a row after a plus sign."""

import math
from typing import Final

import numpy as np

from dropanchor_service.estimation.columns import Array

STREAM: Final = 71  # random stream of the disturbances
LASTING_TAU: Final = 3.0  # s
WHITE, LASTING, MEAN, MOUNT, BIAS, RESTED = "white", "lasting", "mean", "mount", "bias", "rested"
RANGE_ERRORS: Final = ("white0.5", "white1", "lasting0.5", "lasting1", "mean5", "mean10")  # m; m; ranges
PATHS: Final = ("nlos10", "nlosburst", "outage5")
HEADINGS: Final = ("hcorr", "gdrift")
FIELD: Final = (*PATHS, *HEADINGS, "magdist")
"""Typical problems in the field, which the simulator makes: its perturbations of these names."""
BIASES: Final = ("bias0.03", "rested0.1")
"""Standard deviations of the gyroscope's bias, rad/s; rested: after a rest of `REST_S`."""
QUIET: Final = "quiet"
"""An IMU that filters all vibration away: 0.02 m/s² and 0.0015 rad/s of noise, moving and at rest."""
REST_S: Final = 5.0  # s that a tag lies where somebody has put it, before it moves
MOUNTS: Final = ("mount90", "mount-90", "mount135", "mount180")  # degrees


def size(disturbance: str, kind: str) -> float | None:
    """Return the number after the kind in the name of a disturbance, or None if it is of another kind."""
    return float(disturbance.removeprefix(kind)) if disturbance.startswith(kind) else None


def gyro_bias_std(disturbance: str) -> float | None:
    """Return the standard deviation of the gyroscope's bias, rad/s, that a disturbance says, or None."""
    std = size(disturbance, BIAS)
    return size(disturbance, RESTED) if std is None else std


def mounting_angle(disturbance: str) -> float | None:
    """Return the mounting angle, rad, that a disturbance says, or None."""
    degrees = size(disturbance, MOUNT)
    return None if degrees is None else math.radians(degrees)


def disturb_ranges(ranges: Array, disturbance: str, seed: int) -> None:
    """Add white errors, or errors that last for 3 s, to the ranges of one tag, or replace each by the mean of the last.

    Their reported standard deviations would be wrong, so none is reported.
    """
    if not any(disturbance.startswith(kind) for kind in (WHITE, LASTING, MEAN)):
        return
    ranges["std"] = math.nan
    rng = np.random.default_rng([seed, STREAM])
    z = ranges["range"]
    if (std := size(disturbance, WHITE)) is not None:
        z += rng.normal(0.0, std, len(z))
    elif (std := size(disturbance, LASTING)) is not None:
        z += _lasting(rng, ranges["t_ns"] / 1e9, std)
    elif (count := size(disturbance, MEAN)) is not None:
        total = np.cumsum(np.concatenate([np.repeat(z[0], int(count)), z]))
        z[:] = (total[int(count) :] - total[: -int(count)]) / count
    np.maximum(z, 0.0, out=z)


def _lasting(rng: np.random.Generator, t: Array, std: float) -> Array:
    """Return a stationary Gauss-Markov process at the times t, s."""
    kept = np.exp(-np.diff(t, prepend=t[0] - 1e3) / LASTING_TAU)
    noise = rng.normal(0.0, std, len(t)) * np.sqrt(1.0 - kept**2)
    error = np.zeros(len(t))
    for i in range(len(t)):
        error[i] = kept[i] * error[i - 1] + noise[i]
    return error

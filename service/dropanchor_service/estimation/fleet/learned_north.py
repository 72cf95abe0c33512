"""Where north is, as the tracks that began with a told heading have learned it.

Such a track counts its yaw from the heading that was told, and learns what its magnetometer shows beside that:

    measured azimuth - yaw = north + reference error        declination = declination in use + north + reference error

A start without a heading tells less. Its yaw counts from the magnetometer, so where that is far off, its track is wrong
and seems to know it well.
"""

from typing import Final

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.heading_models import FROM_IMU
from dropanchor_service.estimation.fleet.belief.layout import MAGNETOMETER_MODEL, REFERENCE, N
from dropanchor_service.estimation.fleet.belief.pool import slots_of
from dropanchor_service.estimation.north import NORTH

KNOWN_STD: Final = 0.3  # rad, above which a track tells nothing that a look at a plan does not


def have_own_north(rows: Array) -> Array:
    """Return whether the north of each of these ROW is what its told start makes it, whatever the declination is."""
    start, settings = rows["start"], rows["settings"]
    told = (settings["heading_source"] == FROM_IMU) & np.isfinite(settings["heading_std"])
    own: Array = (start["known"] == 1) & np.isfinite(start["heading"]) & ~told
    return own


def learned_norths(numbers: Array, rows: Array, fronts: Array, pool: Array) -> Array:
    """Return NORTH of those of the rows `numbers` whose tracks tell it. rows, fronts: ROW and FRONTEND of all."""
    taken = rows[numbers]
    learned = have_own_north(taken) & (taken["heading"]["model"] == MAGNETOMETER_MODEL) & (taken["count"] > 0)
    numbers, taken = numbers[learned], taken[learned]
    mean, variance = _reference_errors(taken, pool)
    found = np.empty(len(numbers), NORTH)
    found["row"] = numbers
    found["declination"] = _wrapped(fronts["declination"][numbers] + taken["heading"]["north"] + mean)
    found["std"] = np.sqrt(variance + taken["start"]["heading_std"] ** 2)
    return found[found["std"] < KNOWN_STD]


def turn_north(row: Array, front: Array, declination: float) -> None:
    """Let headings of a row with a north of its own count from another declination. Its estimate stays as it is."""
    if row["heading"]["model"] == MAGNETOMETER_MODEL:
        row["heading"]["north"] = wrap(float(row["heading"]["north"] + front["declination"] - declination))
    front["declination"] = declination


def _reference_errors(rows: Array, pool: Array) -> tuple[Array, Array]:
    """Return mean and variance of the error of the heading reference over the hypotheses of each ROW."""
    if not len(rows):
        return np.empty(0), np.empty(0)
    stored = pool[slots_of(rows, pool)]
    begins = np.cumsum(rows["count"]) - rows["count"]
    of_row = np.repeat(np.arange(len(rows)), rows["count"])
    weight = np.exp(stored["log_weight"] - np.maximum.reduceat(stored["log_weight"], begins)[of_row])
    weight /= np.add.reduceat(weight, begins)[of_row]
    error = stored["mean"][:, REFERENCE]
    mean = np.add.reduceat(weight * error, begins)
    variance = stored["cov"][:, REFERENCE * N - REFERENCE * (REFERENCE - 1) // 2]  # of the packed upper triangle
    spread = variance + (error - mean[of_row]) ** 2
    return mean, np.add.reduceat(weight * spread, begins)


def _wrapped(angles: Array) -> Array:
    """Return the angles, rad, in [-pi, pi)."""
    wrapped: Array = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped

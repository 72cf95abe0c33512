"""The sensors of phones whose readings are used, and what a reading must be."""

import math
from collections.abc import Iterable

from dropanchor_schemas.times import why_not_utc
from dropanchor_schemas.wire import ImuSample

TOTAL, LINEAR, GRAVITY = "totalacceleration", "accelerometer", "gravity"
GYROSCOPE, MAGNETOMETER = "gyroscope", "magnetometer"
TITLES = {
    TOTAL: "Total Acceleration",
    LINEAR: "Accelerometer",
    GRAVITY: "Gravity",
    GYROSCOPE: "Gyroscope",
    MAGNETOMETER: "Magnetometer",
}
"""What the app Sensor Logger calls them on its screen."""
SENSORS = tuple(TITLES)
MAX_VALUE = 1e6


class PhoneError(ValueError):
    """A message that cannot be used. The text is a sentence for the person who holds the phone."""


class PhoneTimeError(PhoneError):
    """Readings whose times cannot be UTC."""


def require_utc(samples: Iterable[ImuSample]) -> None:
    """Raise PhoneTimeError if a time of these samples cannot be UTC in ns."""
    why = next((why for sample in samples if (why := why_not_utc(sample.t_ns))), None)
    if why is not None:
        raise PhoneTimeError(f"The times of the readings cannot be used: {why}.")


def is_measurement(*values: float) -> bool:
    """Return whether these can be measured values of a sensor."""
    return all(math.isfinite(value) and abs(value) <= MAX_VALUE for value in values)

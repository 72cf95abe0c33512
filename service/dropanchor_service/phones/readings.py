"""The sensors of phones whose readings are used, and what a reading must be."""

import math

TOTAL, LINEAR, GRAVITY = "totalacceleration", "accelerometer", "gravity"
GYROSCOPE, MAGNETOMETER = "gyroscope", "magnetometer"
SENSORS = (TOTAL, LINEAR, GRAVITY, GYROSCOPE, MAGNETOMETER)
MAX_VALUE = 1e6


class PhoneError(ValueError):
    """A message that cannot be used. The text is a sentence for the person who holds the phone."""


def is_measurement(*values: float) -> bool:
    """Return whether these can be measured values of a sensor."""
    return all(math.isfinite(value) and abs(value) <= MAX_VALUE for value in values)

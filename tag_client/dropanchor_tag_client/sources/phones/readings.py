"""The sensors of phones whose readings are used, and what a reading must be."""

import math

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


def is_measurement(*values: float) -> bool:
    """Return whether these can be measured values of a sensor."""
    return all(math.isfinite(value) and abs(value) <= MAX_VALUE for value in values)

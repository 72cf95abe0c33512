"""IMU samples of a tag on a moving vehicle. Without vibration a tag would seem to rest."""

from random import gauss


def shaken_acc() -> tuple[float, float, float]:
    """Return what an accelerometer measures, m/s²."""
    return gauss(0.0, 0.3), gauss(0.0, 0.3), gauss(9.81, 0.3)


def shaken_gyro() -> tuple[float, float, float]:
    """Return what a gyroscope measures, rad/s."""
    return gauss(0.0, 0.02), gauss(0.0, 0.02), gauss(0.0, 0.02)

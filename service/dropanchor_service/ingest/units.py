"""Convert samples whose units the operator has told."""

from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.decode import Decoded

_FACTORS = ("acc_factor", "gyro_factor", "range_factor")


def has_units(settings: Array) -> bool:
    """Return whether any of these TAG_SETTINGS has another unit than m/s², rad/s and m. Zeros: not configured yet."""
    return any(not ((settings[name] == 1.0) | (settings[name] == 0.0)).all() for name in _FACTORS)


def convert(decoded: Decoded, of_row: Array, settings: Array) -> None:
    """Convert IMU samples and ranges to m/s², rad/s and m, in place. of_row: row of each message, settings: by row."""
    imu, ranges = decoded.imu, decoded.ranges
    of_tag = settings[of_row[imu["message"]]]
    imu["acc"] *= of_tag["acc_factor"][:, None]
    imu["gyro"] *= of_tag["gyro_factor"][:, None]
    factor = settings["range_factor"][of_row[ranges["message"]]]
    ranges["value"] *= factor
    ranges["std"] *= factor

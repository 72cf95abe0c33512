"""Convert decoded samples to the columns that an engine reads."""

import numpy as np

from dropanchor_service.estimation.columns import IMU, Array


def imu_column(samples: Array, of_row: Array) -> Array:
    """Convert IMU_SAMPLE to the IMU column of the engine, in place."""
    imu = samples.view(IMU)
    imu["row"] = of_row[samples["message"]]
    return imu


def scalar_column(scalars: Array, dtype: "np.dtype[np.void]", of_row: Array) -> Array:
    """Convert SCALAR to a column of the engine, with this dtype."""
    column = np.empty(len(scalars), dtype)
    if not len(scalars):
        return column
    names = dtype.names or ()
    column["row"], column["t_ns"] = of_row[scalars["message"]], scalars["t_ns"]
    column[names[-2]], column["std"] = scalars["value"], scalars["std"]
    if "anchor" in names:
        column["anchor"] = scalars["anchor"]
    return column

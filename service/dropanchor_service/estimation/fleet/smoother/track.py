"""The arrays of one hypothesis over all nodes that a smoother fills."""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dropanchor_service.estimation.fleet.belief.layout import Floats, N

MEASUREMENTS: Final = 5  # of one node: heading, speed and gyro at rest or sideways acceleration, speed bound, range


class Track(NamedTuple):
    """One hypothesis over up to n nodes. mean[0], cov[0]: the prior at node 0, whose measurements are not used."""

    reference: Floats  # (n, N)
    mean: Floats  # (n, N) filtered
    cov: Floats  # (n, N, N)
    F: Floats  # (n, 4, N)
    decay: Floats  # (n, N)
    used: npt.NDArray[np.int32]  # (n,) measurements of the node
    H: Floats  # (n, MEASUREMENTS, N)
    PH: Floats  # (n, MEASUREMENTS, N)
    S: Floats  # (n, MEASUREMENTS)
    e: Floats  # (n, MEASUREMENTS)
    share: Floats  # (n, 2) probability that the range is clear, and that it is too long
    nlos: npt.NDArray[np.int32]  # (n,) 1: there is no line of sight
    smooth: Floats  # (n, N)
    smooth_cov: Floats  # (n, N, N)


def make_track(n: int) -> Track:
    """Return room for n nodes."""
    return Track(
        np.zeros((n, N)),
        np.zeros((n, N)),
        np.zeros((n, N, N)),
        np.zeros((n, 4, N)),
        np.ones((n, N)),
        np.zeros(n, np.int32),
        np.zeros((n, MEASUREMENTS, N)),
        np.zeros((n, MEASUREMENTS, N)),
        np.ones((n, MEASUREMENTS)),
        np.zeros((n, MEASUREMENTS)),
        np.tile([1.0, 0.0], (n, 1)),
        np.zeros(n, np.int32),
        np.zeros((n, N)),
        np.zeros((n, N, N)),
    )

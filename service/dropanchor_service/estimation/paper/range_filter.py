"""The Kalman filter that smooths ranges before speed is taken from them (lines 13-14 of Algorithm 1)."""

import numpy as np
from filterpy.kalman import KalmanFilter


class RangeFilter:
    """sRange: a random walk of the range, measured.

        r' = r + e,  e ~ N(0, q dt)          z = r + n,  n ~ N(0, R)

    The paper names the filter and gives neither model nor noise; this is the model of the authors' released code
    (there Q = 0.001 m² per step of 0.005 s, R = 0.1 m², and the first range as the first state).
    """

    def __init__(self, r: float, q: float, R: float) -> None:
        """r: first range, m; q: m²/s; R: m²."""
        self._q = q
        self._filter = KalmanFilter(dim_x=1, dim_z=1)
        self._filter.x = np.array([[r]])
        self._filter.P = np.array([[R]])
        self._filter.R = np.array([[R]])
        self._filter.F = np.eye(1)
        self._filter.H = np.eye(1)

    def step(self, dt: float, z: float) -> float:
        """Return the smoothed range, m, after a range z, m, that comes dt s after the one before."""
        self._filter.predict(Q=np.array([[self._q * dt]]))
        self._filter.update(z)
        return float(self._filter.x[0, 0])

"""The extended Kalman filter of the paper (its equations 1 and 2), based on that of filterpy.

State x = [x, y, theta, v, w]: position, m; direction of travel, rad from east; speed, m/s; turn rate, rad/s.
Functions take the state as an array of shape (5,) and return arrays of shape (5,), (5, 5) or (1, 5).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

Array = NDArray[np.float64]
Position = tuple[float, float, float]

NEAREST = 1e-3  # m: nearer, the direction from the anchor is undefined and a range carries no information

H_HEADING: Array = np.array([[0.0, 0.0, 1.0, 0.0, 0.0]])


def f(x: Array, dt: float) -> Array:
    """Return the state after dt s by the kinematics (1), with the heading in the middle of the interval.

        x' = x + v cos(theta + w dt/2) dt      theta' = theta + w dt      v' = v
        y' = y + v sin(theta + w dt/2) dt                                 w' = w

    The accelerations a and b of (1) are the process noise. A tag may turn by a tenth of a radian between two ranges:
    with the heading at the beginning of the interval, as in the released code, arcs would be too wide.
    """
    px, py, theta, v, w = x.tolist()
    middle = theta + w * dt / 2
    return np.array(
        [px + v * math.cos(middle) * dt, py + v * math.sin(middle) * dt, math.remainder(theta + w * dt, math.tau), v, w]
    )


def F(x: Array, dt: float) -> Array:  # noqa: N802
    """Return df/dx, shape (5, 5)."""
    _, _, theta, v, w = x.tolist()
    c, s = math.cos(theta + w * dt / 2) * dt, math.sin(theta + w * dt / 2) * dt
    return np.array(
        [
            [1.0, 0.0, -v * s, c, -v * s * dt / 2],
            [0.0, 1.0, v * c, s, v * c * dt / 2],
            [0.0, 0.0, 1.0, 0.0, dt],
            [0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )


def h_range(x: Array, anchor: Position) -> float:
    """Return h1 of (2) with heights, m: sqrt((x - x_A)² + (y - y_A)² + dz²). anchor: (x_A, y_A, dz above the tag)."""
    px, py = x[:2].tolist()
    return math.sqrt((px - anchor[0]) ** 2 + (py - anchor[1]) ** 2 + anchor[2] ** 2)


def H_range(x: Array, anchor: Position) -> Array:  # noqa: N802
    """Return dh1/dx = [(x - x_A)/h1, (y - y_A)/h1, 0, 0, 0], shape (1, 5), zero at the anchor."""
    r = h_range(x, anchor)
    if r < NEAREST:
        return np.zeros((1, 5))
    px, py = x[:2].tolist()
    return np.array([[(px - anchor[0]) / r, (py - anchor[1]) / r, 0.0, 0.0, 0.0]])


class Innovation(NamedTuple):
    """The innovation of a range: predicted, m, y = z - predicted, its variance S, m², and whether it was fused."""

    predicted: float
    y: float
    S: float
    fused: bool


class PoseFilter(ExtendedKalmanFilter):  # type: ignore[misc]
    """Belief (x, P) of one tag.

    Q = diag(q) dt: q are noise powers per second of [x, y, theta, v, w], so that any step length may follow any.
    """

    def __init__(self, x: Array, P: Array, q: Array) -> None:
        """x: shape (5,); P: shape (5, 5); q: shape (5,), in m²/s, m²/s, rad²/s, (m/s)²/s, (rad/s)²/s."""
        super().__init__(dim_x=5, dim_z=1)
        self.x = np.array(x)
        self.P = np.array(P)
        self._q = np.diag(q)
        self._dt = 0.0

    def predict_x(self, u: Any = 0) -> None:  # noqa: ARG002 - filterpy's name for its hook
        """The hook filterpy offers for a prediction that is not linear."""
        self.x = f(self.x, self._dt)

    def advance(self, dt: float) -> None:
        """Predict dt s ahead: x' = f(x), P' = F P F^T + diag(q) dt."""
        self._dt = dt
        self.F = F(self.x, dt)
        self.Q = self._q * dt
        self.predict()

    def update_heading(self, z: float, R: float) -> None:
        """Fuse a direction of travel z, rad, of variance R, rad². The innovation is wrapped to [-pi, pi]."""
        innovation = math.remainder(z - float(self.x[2]), math.tau)
        self.update(np.array([innovation]), lambda _: H_HEADING, lambda _: np.zeros(1), R=R)
        self.x[2] = math.remainder(float(self.x[2]), math.tau)

    def update_range(self, z: float, R: float, anchor: Position, gate: float) -> Innovation:
        """Fuse a range z, m, of variance R, m², unless its nis y²/S exceeds gate²."""
        H = H_range(self.x, anchor)
        predicted = h_range(self.x, anchor)
        y = z - predicted
        S = float((H @ self.P @ H.T)[0, 0]) + R
        if not y * y <= gate * gate * S:
            return Innovation(predicted, y, S, False)
        self.update(np.array([y]), lambda _: H, lambda _: np.zeros(1), R=R)
        self.x[2] = math.remainder(float(self.x[2]), math.tau)
        return Innovation(predicted, y, S, True)

    @property
    def finite(self) -> bool:
        """Return whether all numbers of the belief are finite and all variances positive."""
        return bool(np.isfinite(self.x).all() and np.isfinite(self.P).all() and (self.P.diagonal() > 0).all())

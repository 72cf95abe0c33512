"""Three numbers as a tuple, and what is computed with them inside kernels."""

import math

from dropanchor_service.estimation.fleet.compiled import njit

Vector = tuple[float, float, float]


@njit(nogil=True)
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(nogil=True)
def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(nogil=True)
def combined(a: Vector, p: float, b: Vector, q: float) -> Vector:
    """Return p a + q b."""
    return (p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2])


@njit(nogil=True)
def norm(a: Vector) -> float:
    """Return the length."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])

"""How the kernels are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

RELAXED = {"contract", "nsz"}  # fused multiply-add; infinities and NaN keep their meaning


def njit(**options: Any) -> Callable[[Kernel], Kernel]:
    """numba's, for arithmetic that does not raise: a division by zero is inf or NaN, and the row's own fault."""
    compiled: Callable[[Kernel], Kernel] = numba.njit(error_model="numpy", fastmath=RELAXED, **options)
    return compiled

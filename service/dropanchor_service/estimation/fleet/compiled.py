"""How the kernels are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

RELAXED = {"contract", "nsz"}  # fused multiply-add; infinities and NaN keep their meaning


def njit(borrows: bool = False, **options: Any) -> Callable[[Kernel], Kernel]:
    """Return numba's `njit` with arithmetic that does not raise: a division by zero gives inf or NaN.

    borrows: the kernel makes and returns no array, so it counts no references to those that it is given. To count them
    took a twelfth of the time of the belief.
    """
    if borrows:
        options["_nrt"] = False
    compiled: Callable[[Kernel], Kernel] = numba.njit(error_model="numpy", fastmath=RELAXED, **options)
    return compiled

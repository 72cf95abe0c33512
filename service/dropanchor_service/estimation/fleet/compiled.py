"""How the kernels are compiled."""

from collections.abc import Callable
from typing import Any, ClassVar, NoReturn, TypeVar

import numba
from numba.core.registry import CPUDispatcher

from dropanchor_service.estimation.fleet.plain_python import in_plain_python

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

RELAXED = {"contract", "nsz"}  # fused multiply-add; infinities and NaN keep their meaning


class Inner(CPUDispatcher):
    """A kernel that only other kernels call.

    It has no wrapper for calls from Python: those of 400 kernels took a third of the time that compiling takes.
    """

    called_from_python: ClassVar = False
    """Whether kernels that are defined from now on get the wrapper all the same: tests call them."""

    def __call__(self, *_: object, **__: object) -> NoReturn:
        """Refuse: without the wrapper a call would end the process."""
        raise TypeError(f"only kernels call {self.py_func.__name__}: njit(cache=True) makes one that Python may call")


def njit(borrows: bool = False, cache: bool = False, **options: Any) -> Callable[[Kernel], Kernel]:
    """Return numba's `njit` with arithmetic that does not raise: a division by zero gives inf or NaN.

    borrows: the kernel makes and returns no array, so it counts no references to those that it is given. To count them
    took a twelfth of the time of the belief. cache: it is kept on disk, and Python may call it.
    """
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return in_plain_python
    if borrows:
        options["_nrt"] = False
    inner = not cache and not Inner.called_from_python
    options |= {"cache": cache, "no_cfunc_wrapper": True, "no_cpython_wrapper": inner}

    def compiled(function: Kernel) -> Kernel:
        kernel: Any = numba.njit(error_model="numpy", fastmath=RELAXED, **options)(function)
        if inner:
            kernel.__class__ = Inner
        return kernel  # type: ignore[no-any-return]

    return compiled

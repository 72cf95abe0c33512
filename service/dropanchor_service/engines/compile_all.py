"""Compile all kernels, on two processors where there are two.

The belief and the front-end of the estimator take about as long, and share no kernel that takes long.
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from dropanchor_service.engines.choose import create_engine
from dropanchor_service.engines.warm_up import (
    warm_up_answers,
    warm_up_belief,
    warm_up_front_end,
    warm_up_ingest,
    warm_up_zones,
)
from dropanchor_service.runtime import logs
from dropanchor_service.runtime.kernel_cache import use_kernel_cache
from dropanchor_service.runtime.processors import usable_processors
from dropanchor_service.settings.model import Settings


def compile_all() -> None:
    """Fill the cache of the kernels."""
    use_kernel_cache()
    with _rest_apart():
        warm_up_belief()
        warm_up_ingest()
        warm_up_answers()
    create_engine(Settings(engine="fleet"))  # loads what is compiled, and compiles what is missing


@contextmanager
def _rest_apart() -> Iterator[None]:
    """Compile the rest in another process meanwhile, if there is a processor for it."""
    if usable_processors() < 2:
        _warm_up_rest()
        yield
        return
    with subprocess.Popen([sys.executable, "-m", __name__], stdin=subprocess.DEVNULL) as other:
        try:
            yield
        except BaseException:
            other.terminate()
            raise


def _warm_up_rest() -> None:
    warm_up_front_end()
    warm_up_zones()


if __name__ == "__main__":
    logs.configure("ERROR")  # the other process tells of its progress
    _warm_up_rest()

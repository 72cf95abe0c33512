"""A numba cache that depends on all sources of kernels that other files call.

numba checks only the file of the outermost kernel. After a change in a file that the kernel calls, numba would still
run the old code. So the folder of the cache is named after a digest of the sources. Set it before numba is imported.
"""

import fcntl
import functools
import os
import subprocess
import sys
from pathlib import Path

from support.commands import environment

ROOT = Path(__file__).parents[2]
_REST = """
import numpy as np

from dropanchor_evaluation.bounds.linear import LinearModel
from dropanchor_evaluation.paper.compiled import algorithm1
from dropanchor_service.engines.warm_up import warm_up_answers, warm_up_front_end, warm_up_ingest, warm_up_zones
from dropanchor_service.estimation.paper.parameters import TUNED

for warm_up in (warm_up_front_end, warm_up_ingest, warm_up_answers, warm_up_zones):
    warm_up()
algorithm1(np.arange(2.0), np.zeros(2), np.ones(2), (1.0, 0.0, 0.0), TUNED)
model = LinearModel(2)
for name in "xy":
    model.state(name, 1.0)
model.move("x", "y", 1.0)
model.observe(1.0, {"x": 1.0})
model.bound(draws=0, seed=0)
"""


def use_cache_of_these_sources() -> None:
    """Set NUMBA_CACHE_DIR for this process and its children, unless it is set already."""
    from dropanchor_service.runtime.kernel_cache import check_files, sources_digest, use_processor_family

    use_processor_family()
    check_files()
    os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / ".numba_cache" / sources_digest()))
    from dropanchor_service.estimation.fleet.compiled import Inner

    Inner.called_from_python = True


@functools.cache
def compile_once() -> None:
    """Fill the cache, so that a service can start within a time limit. One process compiles while the others wait."""
    mark = _mark("filled")
    mark.parent.mkdir(parents=True, exist_ok=True)
    with (mark.parent / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not mark.exists():
            subprocess.run([sys.executable, "-m", "dropanchor_service", "compile"], env=environment(), check=True)
            mark.touch()


def _mark(what: str) -> Path:
    """Return the file that says that this is done."""
    from dropanchor_service.runtime.kernel_cache import mark_of

    return mark_of(Path(os.environ["NUMBA_CACHE_DIR"]), what)


def prepare() -> None:
    """Compile the kernels, unless that was done with these sources. Without this each worker compiles them."""
    if (mark := _mark("prepared")).exists():
        return
    sys.stdout.write("== compiling the estimators, for minutes (once after a change of them)\n")
    compile_with_smoothers()
    mark.touch()


def compile_with_smoothers() -> None:
    """Fill the cache with what the service and the tests of smoothing and of the paper need, on two processors.

    The smoothers follow the belief in its process, which has compiled most of what they call.
    """
    from dropanchor_service.engines.warm_up import warm_up_belief

    with subprocess.Popen([sys.executable, "-c", _REST], env=environment()) as rest:
        warm_up_belief()
    assert rest.returncode == 0
    _compile_smoothers()
    compile_once()  # finds all, and notes that the cache is full


def _compile_smoothers() -> None:
    from dropanchor_service.estimation.fleet.smoother.smoothed import smoothed_poses
    from support.fleet_runs import traced

    engine, _, _ = traced(seed=1)
    for lag in (None, 1.0):
        smoothed_poses(engine, 0, lag)


if __name__ == "__main__":
    use_cache_of_these_sources()
    prepare()

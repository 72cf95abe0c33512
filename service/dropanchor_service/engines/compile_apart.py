"""Compile in a process of its own: compiling leaves its process with some 500 MB that it never needs again."""

import logging
import os
import signal
import subprocess
import sys
from pathlib import Path

from dropanchor_service.engines.compilation import PROGRESS_S, CompilationProgress, how_often, where_kept
from dropanchor_service.engines.warm_up import ESTIMATOR
from dropanchor_service.runtime.kernel_cache import VARIABLE, has_room, is_full, mark_of

_OF_ONE = 4 << 20  # bytes: more than any kernel has

_log = logging.getLogger(__name__)


def compile_apart(progress: CompilationProgress) -> None:
    """Fill the cache of the kernels with `dropanchor compile`, unless it is full or cannot be written.

    When this fails, the caller compiles what is missing: more memory, but no harm. An exception ends the process, too.
    """
    if (mark := _mark()) is None or is_full(mark.parent):
        return
    if not has_room(mark.parent):
        _log.warning("%s has no room for the compiled estimator: what it lacks is compiled into memory", mark.parent)
        return
    shown = f"; {progress.page} shows the progress" if progress.page else ""
    progress.begin(ESTIMATOR)
    _log.warning("compiling the estimator; please wait. %s%s", how_often(), shown)
    try:
        _run(progress)
    except OSError as error:
        _log.warning(
            "no process could be started to compile in (%s): the service compiles by itself, and then needs some "
            "500 MB more memory until its next start",
            error,
        )
    if mark.exists():
        _log.warning("compiled in %.0f s%s", progress.elapsed_s, where_kept())
    progress.end()


def _run(progress: CompilationProgress) -> None:
    """Run `dropanchor compile` to its end. Raises OSError when it cannot be started."""
    command = [sys.executable, "-m", "dropanchor_service", "compile"]
    # A session of its own: Ctrl-C goes to the service, which ends the process.
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True) as made:
        try:
            while made.poll() is None:
                try:
                    made.wait(PROGRESS_S)
                except subprocess.TimeoutExpired:
                    _log.warning("compiling: %.0f s so far", progress.elapsed_s)
        finally:
            if made.poll() is None:
                os.killpg(made.pid, signal.SIGTERM)  # and the process that it has started


def mark_complete() -> bool:
    """Note in the cache that all kernels are compiled for this processor. Return whether it has room for them."""
    if (mark := _mark()) is None or not has_room(mark.parent, _OF_ONE):
        return False
    mark.touch()
    return True


def _mark() -> Path | None:
    folder = os.environ.get(VARIABLE)
    return None if folder is None else mark_of(Path(folder))

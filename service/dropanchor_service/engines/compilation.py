"""How far the compilation of kernels has come, for logs, terminals and the page."""

import logging
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from dropanchor_schemas.sentences import say
from dropanchor_service.runtime.kernel_cache import VARIABLE, is_kept

PROGRESS_S = 5.0
IMPORT_BLOCKED: Final[Any] = None  # in sys.modules it makes an import fail

_log = logging.getLogger(__name__)


class CompilationProgress:
    """How far compiling has come. The thread that compiles writes; any thread reads.

    page: URL of the page that shows the progress; "" without one.
    """

    def __init__(self, page: str = "") -> None:
        self.page = page
        self._what = ""
        self._began_s = 0.0

    def begin(self, what: str) -> None:
        self._what, self._began_s = what, time.monotonic()

    def end(self) -> None:
        self._what = ""

    @property
    def elapsed_s(self) -> float:
        return time.monotonic() - self._began_s

    @property
    def sentence(self) -> str:
        """What the service does before it is ready, for people."""
        if not self._what:
            return say("starting", "The service is starting.")
        return say(
            "compiling",
            "The service compiles {what}: {seconds} s so far. {often}.",
            what=self._what,
            seconds=f"{self.elapsed_s:.0f}",
            often=how_often(),
        )


def how_often() -> str:
    """Return how often the kernels are compiled, for people."""
    if is_kept():
        return say("compiled_once", "This happens once after an update")
    return say("compiled_always", "This happens at every start; the log says why")


def where_kept() -> str:
    """Return where the compiled kernels are kept, as the end of a sentence."""
    return f"; the result is cached in {os.environ.get(VARIABLE)}" if is_kept() else ""


@contextmanager
def compiling(what: str, progress: CompilationProgress) -> Iterator[None]:
    """Log and note the progress of compiling, because a minute of silence looks like a fault.

    The level is WARNING, so that the lines appear at any usual log level.
    """
    from numba.core.event import Event, Listener, install_listener

    class Progress(Listener):
        """Receives an event for each of hundreds of functions."""

        has_begun = False
        logged = 0.0

        def on_start(self, event: Event) -> None:  # noqa: ARG002
            if not self.has_begun:
                self.has_begun, self.logged = True, time.monotonic()
                progress.begin(what)
                shown = f"; {progress.page} shows the progress" if progress.page else ""
                _log.warning("compiling %s; please wait. %s%s", what, how_often(), shown)
            elif time.monotonic() - self.logged >= PROGRESS_S:
                self.logged = time.monotonic()
                _log.warning("compiling: %.0f s so far", progress.elapsed_s)

        def on_end(self, event: Event) -> None: ...

    listener = Progress()
    with _without_blas(), install_listener("numba:compile", listener):
        yield
    if listener.has_begun:
        _log.warning("compiled in %.0f s%s", progress.elapsed_s, where_kept())
        progress.end()


@contextmanager
def _without_blas() -> Iterator[None]:
    """Keep numba from importing scipy.linalg, where it looks for BLAS.

    No kernel here calls BLAS. The import would cost every start 0.2 s of processor time and 14 MB of memory.
    """
    found = sys.modules.setdefault("scipy.linalg", IMPORT_BLOCKED)
    try:
        yield
    finally:
        if found is IMPORT_BLOCKED:
            del sys.modules["scipy.linalg"]

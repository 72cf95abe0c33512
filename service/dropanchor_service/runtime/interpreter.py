"""Set up the interpreter of a process that serves sites."""

import gc
import sys

from dropanchor_service.runtime import open_files
from dropanchor_service.runtime.memory import share_arenas

# The garbage collector runs less often: messages are thousands of tuples without reference cycles.
_GC_THRESHOLD = 10_000, 20, 20
_SWITCH_INTERVAL_S = 0.0005  # threads yield the interpreter soon, so that queries do not wait for the engine


def prepare_to_serve() -> None:
    open_files.raise_limit()
    share_arenas()
    gc.set_threshold(*_GC_THRESHOLD)
    sys.setswitchinterval(_SWITCH_INTERVAL_S)

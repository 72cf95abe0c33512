"""`dropanchor compile`: compile the estimator ahead of the first start, for example when an image is built."""

import argparse
import os
import sys

from dropanchor_service.commands.options import add_log_option
from dropanchor_service.engines.compile_all import compile_all
from dropanchor_service.engines.compile_apart import mark_complete
from dropanchor_service.runtime import logs
from dropanchor_service.runtime.kernel_cache import VARIABLE

DESCRIPTION = """\
Compiles the estimator and caches the result, so that the first start of `dropanchor serve` is as fast as any other.
The cache is in $XDG_CACHE_HOME/dropanchor (~/.cache/dropanchor), or in $NUMBA_CACHE_DIR if that is set. Without a
writable home it is in $DROPANCHOR_DATA_DIR, the data folder of the service. It is valid for this version on this type
of processor; otherwise the service compiles again.
"""
EPILOG = """\
examples:
  dropanchor compile
  XDG_CACHE_HOME=/var/cache dropanchor compile      for a service with the same XDG_CACHE_HOME
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_log_option(parser)


def run(arguments: argparse.Namespace) -> int:
    logs.configure(arguments.log_level)
    compile_all()
    if mark_complete():
        return 0
    print(f"there is no room for the compiled estimator in {os.environ[VARIABLE]}", file=sys.stderr)
    return 1

"""`dropanchor compile`: what the first start would do, done when an image or a machine is prepared."""

import argparse

from dropanchor_service.commands.options import add_log_option
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.engines.warm_up import warm_up_answers, warm_up_ingest
from dropanchor_service.runtime import logs
from dropanchor_service.settings.model import Settings

DESCRIPTION = """\
Compiles the estimator and keeps the result, so that the first start of `dropanchor serve` is as fast as any other.
The result lies in $XDG_CACHE_HOME/dropanchor (~/.cache/dropanchor), or in $NUMBA_CACHE_DIR where that is set. It is
made for the processor it is compiled on and for this version; for another one the service compiles again.
"""
EPILOG = """\
examples:
  dropanchor compile
  XDG_CACHE_HOME=/var/cache dropanchor compile      for a service that runs with the same XDG_CACHE_HOME
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_log_option(parser)


def run(arguments: argparse.Namespace) -> int:
    logs.configure(arguments.log_level)
    create_engine(Settings(engine="fleet"))
    warm_up_ingest()
    warm_up_answers()
    return 0

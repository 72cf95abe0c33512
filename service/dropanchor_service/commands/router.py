"""`dropanchor router`: a Zenoh router alone, so that it and the service can be restarted one by one."""

import argparse
import logging
import sys

from dropanchor_service import logs
from dropanchor_service.commands.options import add_log_option
from dropanchor_service.settings_sources import SettingsError, load_settings
from dropanchor_service.signals import interrupts
from dropanchor_service.zenoh_session import ZenohError, open_session

DESCRIPTION = "Runs a Zenoh router until Ctrl-C or SIGTERM. Tags and services connect to it."
EPILOG = """\
examples:
  dropanchor router
  dropanchor router --zenoh-listen tcp/127.0.0.1:7448
  dropanchor serve --zenoh-connect tcp/127.0.0.1:7448      in another terminal
"""

_log = logging.getLogger(__name__)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--zenoh-listen", metavar="ENDPOINT", help="where it listens (tcp/127.0.0.1:7447)")
    add_log_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 when it was stopped, 2 when it could not start."""
    logs.configure(arguments.log_level)
    listen = {"zenoh": {"listen": arguments.zenoh_listen}} if arguments.zenoh_listen else {}
    try:
        settings = load_settings(options=listen).zenoh.model_copy(update={"connect": ()})
        with interrupts() as interrupt, open_session(settings):
            _log.info("ready at %s", ", ".join(settings.listen))
            interrupt.wait(lambda: True)
    except (SettingsError, ZenohError) as error:
        sys.stderr.write(f"dropanchor router: {error}\n")
        return 2
    return 0

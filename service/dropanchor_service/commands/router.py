"""`dropanchor router`: run a separate Zenoh router, so that it and the service can be restarted independently."""

import argparse
import logging
import sys

from dropanchor_service.commands.options import add_log_option, add_security_options, router_settings
from dropanchor_service.runtime import logs, open_files
from dropanchor_service.runtime.signals import interrupts
from dropanchor_service.security.credentials import credentials_of
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.zenoh_io.exposure import refuse_exposure
from dropanchor_service.zenoh_io.session import ZenohError, listening_at, open_session

DESCRIPTION = "Runs a Zenoh router for tags and services until Ctrl-C or SIGTERM."
EPILOG = """\
examples:
  dropanchor router
  dropanchor router --zenoh-listen tcp/127.0.0.1:7448
  dropanchor serve --zenoh-connect tcp/127.0.0.1:7448      in another terminal
  dropanchor router --security security                    with certificates and access control
"""

_log = logging.getLogger(__name__)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--zenoh-listen", metavar="ENDPOINT", help="endpoint of the router (default: tcp/127.0.0.1:7447)"
    )
    add_security_options(parser)
    add_log_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the router. Return 0 if it was stopped, 2 if it could not start."""
    logs.configure(arguments.log_level)
    open_files.raise_limit()
    try:
        settings = router_settings(arguments)
        credentials = credentials_of(settings)
        refuse_exposure(settings, credentials)
        with interrupts() as interrupt, open_session(settings.zenoh, credentials):
            _log.info("ready at %s", ", ".join(listening_at(settings.zenoh, credentials)))
            interrupt.wait(lambda: True)
    except (SettingsError, ZenohError) as error:
        sys.stderr.write(f"dropanchor router: {error}\n")
        return 2
    return 0

"""`dropanchor router`: run a separate Zenoh router, so that it and the service can be restarted independently."""

import argparse
import logging

from dropanchor_service.commands.options import add_log_option, add_security_options, router_settings
from dropanchor_service.runtime import logs, open_files
from dropanchor_service.runtime.signals import interrupts
from dropanchor_service.security.credentials import credentials_of
from dropanchor_service.security.folder import TABLE, SecurityFolder
from dropanchor_service.security.router_file import RouterFileError, unused_changes
from dropanchor_service.settings.model import ZenohSettings
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

REFUSED = (SettingsError, ZenohError)
_log = logging.getLogger(__name__)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--zenoh-listen", metavar="ENDPOINT", help="endpoint of the router (default: tcp/127.0.0.1:7447)"
    )
    add_security_options(parser)
    add_log_option(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the router until it is stopped. Raises REFUSED if it cannot start."""
    logs.configure(arguments.log_level)
    open_files.raise_limit()
    settings = router_settings(arguments)
    credentials = credentials_of(settings)
    refuse_exposure(settings, credentials)
    with interrupts() as interrupt, open_session(settings.zenoh, credentials):
        _say_what_is_used(settings.zenoh, credentials)
        interrupt.wait(lambda: True)


def _say_what_is_used(settings: ZenohSettings, credentials: SecurityFolder | None) -> None:
    """Log where the router listens, and which files say so."""
    if settings.config_file is not None:
        _log.info("ready with the configuration in %s, and no other file", settings.config_file)
        return
    endpoints = ", ".join(listening_at(settings, credentials))
    if credentials is None:
        _log.info("ready at %s", endpoints)
        return
    file = credentials.router_file
    source = "as given, not as in" if "listen" in settings.model_fields_set else "as in"
    _log.info("ready at %s (%s %s); access control as in %s", endpoints, source, file, credentials.path / TABLE)
    try:
        changes = unused_changes(file, credentials.router_configuration(listening_at(settings, credentials)))
    except RouterFileError as error:
        _log.warning("%s", error)
        return
    if changes:
        _log.warning(
            "%s has other sections than this command uses: %s. Of this file only `listen` counts; all else follows "
            "from %s and is written anew by the next `dropanchor tag add`",
            file,
            ", ".join(changes),
            TABLE,
        )

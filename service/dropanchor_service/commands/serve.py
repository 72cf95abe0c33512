"""`dropanchor serve`: run the service until it is stopped."""

import argparse
import logging
import sys
from typing import Protocol

from dropanchor_service.api.http.server import ListenError
from dropanchor_service.commands.lan import show_addresses
from dropanchor_service.commands.options import add_service_options, settings_of
from dropanchor_service.runtime import logs
from dropanchor_service.runtime.interpreter import prepare_to_serve
from dropanchor_service.runtime.memory import HeapTrimmer, give_back_files
from dropanchor_service.runtime.private_files import keep_private
from dropanchor_service.runtime.signals import interrupts
from dropanchor_service.runtime.systemd import Systemd
from dropanchor_service.service import Service
from dropanchor_service.settings.served import served_settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.zenoh_io.session import ZenohError

DESCRIPTION = """\
Runs the service until Ctrl-C or SIGTERM. Without settings, the site is `default`, a built-in Zenoh router listens on
the loopback, the anchor of the first range becomes the origin, and every tag that sends samples gets a track.
SIGHUP reads the settings of anchors and tags and the certificate again, and says what else needs a restart.
"""
EPILOG = """\
examples:
  dropanchor serve
  dropanchor serve --port 8081 --zenoh-listen tcp/127.0.0.1:7448
  dropanchor serve --zenoh-connect tcp/10.0.0.5:7447 --config yard.toml
  DROPANCHOR_UNKNOWN_TAGS=refuse dropanchor serve --config yard.toml

all settings, of which these options are some:
  dropanchor settings --show        what is in force, and where it comes from
  dropanchor check --config FILE    whether the service would start with them
  What each means: reference/settings.html below /help of a running service, or service/docs/reference/settings.md

a settings file:
  unknown_tags = "refuse"
  [[site.anchors]]
  id = "1"
  z = 2.5
  [tags.forklift-1]
  height_m = 1.2
  start = { x = 10.0, y = 0.0, heading_rad = 1.57 }
"""

_log = logging.getLogger(__name__)

REFUSED = (SettingsError, ListenError, ZenohError)
EXIT_DIED = 1
EXIT_GONE = 75  # EX_TEMPFAIL of sysexits.h: another process serves the sites, and a restart begins as a standby


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_service_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the service. Return 0 if it was stopped, 1 if it died, 75 if another took over. Raises REFUSED."""
    logs.configure(arguments.log_level)
    prepare_to_serve()
    systemd = Systemd()

    def standing_by() -> None:
        systemd.ready()
        systemd.progress()

    try:
        settings = served_settings(settings_of(arguments))
        keep_private(settings.data_dir)
        with interrupts() as interrupt, Service(settings, interrupt.raising(), standing_by) as service:
            systemd.ready()
            show_addresses(service.url, sys.stdout)
            give_back_files()
            heap = HeapTrimmer()
            stopped = interrupt.wait(lambda: supervise(service, systemd, heap), lambda: reload(service, arguments))
            systemd.stopping()
    except KeyboardInterrupt:
        return 0
    if not stopped and service.gone:
        sys.stderr.write(f"dropanchor serve: {service.gone}. Started again, this process is a standby\n")
        return EXIT_GONE
    return 0 if stopped else EXIT_DIED


def reload(service: Service, arguments: argparse.Namespace) -> None:
    """Read the settings again. Settings with an error change nothing."""
    try:
        service.reload(served_settings(settings_of(arguments)))
    except SettingsError as error:
        _log.error("the settings cannot be used, and stay as they were: %s", error)


class Supervised(Protocol):
    @property
    def makes_progress(self) -> bool: ...

    @property
    def has_died(self) -> bool: ...


def supervise(service: Supervised, systemd: Systemd, heap: HeapTrimmer) -> bool:
    """Report progress to systemd and return whether the service still runs. Call this twice a second.

    A service that is stuck reports no progress, so systemd restarts it.
    """
    if service.makes_progress:
        systemd.progress()
    heap.trim()
    return not service.has_died

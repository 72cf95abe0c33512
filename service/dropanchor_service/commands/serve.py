"""`dropanchor serve`: the service until it is stopped."""

import argparse
import gc
import sys
from typing import Protocol

from dropanchor_service.api.http.server import ListenError
from dropanchor_service.commands.options import add_service_options, settings_of
from dropanchor_service.runtime import logs, open_files
from dropanchor_service.runtime.memory import HeapTrimmer
from dropanchor_service.runtime.signals import interrupts
from dropanchor_service.runtime.systemd import Systemd
from dropanchor_service.service import Service
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.zenoh_io.session import ZenohError

DESCRIPTION = """\
Runs the service until Ctrl-C or SIGTERM. Without settings: site `default`, a Zenoh router of its own on the loopback,
the first anchor that is heard becomes the origin, and every tag that is heard gets a track.
"""
EPILOG = """\
examples:
  dropanchor serve
  dropanchor serve --port 8081 --zenoh-listen tcp/127.0.0.1:7448
  dropanchor serve --zenoh-connect tcp/10.0.0.5:7447 --config yard.toml
  DROPANCHOR_UNKNOWN_TAGS=refuse dropanchor serve --config yard.toml

a settings file:
  unknown_tags = "refuse"
  [[site.anchors]]
  id = "1"
  z = 2.5
  [tags.forklift-1]
  height_m = 1.2
  start = { x = 10.0, y = 0.0, heading_rad = 1.57 }
"""
GARBAGE = 10_000, 20, 20  # more objects until there is a look for cycles: messages are thousands of tuples, in none
SWITCH_S = 0.0005  # that a thread which waits for the interpreter lets another one go on: poses are asked for meanwhile
UNUSABLE = 2
DIED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_service_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 when it was stopped, 1 when it died, 2 when it could not start."""
    logs.configure(arguments.log_level)
    open_files.raise_limit()
    gc.set_threshold(*GARBAGE)
    sys.setswitchinterval(SWITCH_S)
    systemd = Systemd()
    try:
        with interrupts() as interrupt:
            with interrupt.raising():  # it may have to compile the estimator
                made = Service(settings_of(arguments))
            with made as service:
                systemd.ready()
                heap = HeapTrimmer()
                stopped = interrupt.wait(lambda: goes_on(service, systemd, heap))
                systemd.stopping()
    except KeyboardInterrupt:
        return 0
    except (SettingsError, ListenError, ZenohError) as error:
        sys.stderr.write(f"dropanchor serve: {error}\n")
        return UNUSABLE
    return 0 if stopped else DIED


class Supervised(Protocol):
    @property
    def makes_progress(self) -> bool: ...

    @property
    def has_died(self) -> bool: ...


def goes_on(service: Supervised, systemd: Systemd, heap: HeapTrimmer) -> bool:
    """Asked twice a second. A service that is stuck says nothing to systemd, which starts it again."""
    if service.makes_progress:
        systemd.progress()
    heap.trim()
    return not service.has_died

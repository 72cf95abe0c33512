"""Publish what a UWB module on a serial port reports: a tag, or an anchor that reports several tags."""

import argparse
import math
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from dropanchor_tag_client.command_line import did_you_mean
from dropanchor_tag_client.options import (
    add_anchor_name_option,
    add_calibration_option,
    add_connection_options,
    add_spool_options,
    anchor_names,
    opened_client,
    opened_session,
    spool_settings,
)
from dropanchor_tag_client.sources.axes import AXES, mounting
from dropanchor_tag_client.sources.modules.catalogue import MODULES, SUFFIX
from dropanchor_tag_client.sources.modules.detect import Arrived
from dropanchor_tag_client.sources.modules.device_clock import DeviceClock
from dropanchor_tag_client.sources.modules.module import Module, commands
from dropanchor_tag_client.sources.modules.outlet import Azimuth, ManyTags, OneTag, Outlet
from dropanchor_tag_client.sources.modules.reader import Reader
from dropanchor_tag_client.sources.modules.status_log import StatusLog
from dropanchor_tag_client.upkeep import Upkeep

_FLUSH_S = 0.1
_AUTO = "auto"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("port", metavar="PORT", help="such as /dev/ttyACM0 or /dev/serial/by-id/…; COM3 on Windows")
    parser.add_argument("--tag", help="id of the tag (default: the one of --credentials)")
    parser.add_argument(
        "--module",
        type=_module_name,
        default=_AUTO,
        metavar="NAME|FILE",
        help=f"{', '.join(MODULES)}, a file NAME.toml with patterns, or auto: listen and find out (default: auto)",
    )
    parser.add_argument(
        "--pattern",
        action="append",
        default=[],
        metavar="TEXT",
        help="how a line of the module looks: 'from: {anchor} Range: {range:m}'; may be given several times",
    )
    parser.add_argument("--baud", type=int, help="baud rate (default: as the module is delivered)")
    parser.add_argument("--start", metavar="COMMAND", help="what to send to a module that reports nothing")
    parser.add_argument(
        "--poll",
        action="append",
        default=[],
        metavar="COMMAND",
        help="what to send ten times per second to a module that measures only when asked; may be given several times",
    )
    add_anchor_name_option(parser, "the module calls")
    gateway = parser.add_argument_group("when the module is an anchor")
    gateway.add_argument(
        "--tag-from-id", action="store_true", help="publish each tag that it reports under its own id, after --tag"
    )
    gateway.add_argument("--as-anchor", metavar="NAME", help="the module is this anchor, what it names are tags")
    gateway.add_argument(
        "--azimuth-std", type=float, default=10.0, metavar="DEG", help="error of its azimuths (default: %(default)s)"
    )
    gateway.add_argument("--mirrored", action="store_true", help="its azimuths go the other way: it hangs upside down")
    imu = parser.add_argument_group("how its IMU is mounted")
    imu.add_argument(
        "--forward", choices=AXES, default="x", help="the axis that points forward; --forward=-y (default: %(default)s)"
    )
    imu.add_argument("--up", choices=AXES, default="z", help="the axis that points up (default: %(default)s)")
    add_connection_options(parser)
    add_spool_options(parser)
    add_calibration_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Publish until interrupted. Raises PortError, ConnectError, ValueError."""
    _check(arguments)
    module, log = _module(arguments), StatusLog()
    reader = Reader(arguments.port, module, arguments.baud, arguments.start, commands(arguments.poll), log.add)
    reports = reader.reports()
    next(reports)  # report a port that cannot be opened before waiting for the router
    try:
        with _outlet(arguments, log) as outlet:
            publish(reader, reports, outlet, log)
    finally:
        log.write(is_last=True)
        sys.stderr.write(f"{log.summary(reader.dropped)}\n")
    return 0


def publish(reader: Reader, reports: Iterator[Arrived], outlet: Outlet, log: StatusLog) -> None:
    """Publish all reports. Runs for ever."""
    clock, flushed_s = DeviceClock(), time.monotonic()
    for arrival_ns, found in reports:
        for report in found:
            t_ns = arrival_ns if report.device_ns is None else clock.utc_ns(arrival_ns, report.device_ns)
            outlet.publish(report, t_ns)
            log.add_report(report, reader.dropped)
        if time.monotonic() - flushed_s > _FLUSH_S:
            flushed_s = time.monotonic()
            outlet.flush()
            log.add_dropped(reader.dropped)
            log.write()


@contextmanager
def _outlet(arguments: argparse.Namespace, log: StatusLog) -> Iterator[Outlet]:
    names = anchor_names(arguments)
    mounted = mounting(arguments.forward, arguments.up)
    with ExitStack() as stack:
        if not arguments.tag_from_id:
            client = stack.enter_context(opened_client(arguments, arguments.tag))
            yield OneTag(client, names, mounted, log)
            return
        session = stack.enter_context(opened_session(arguments))
        options = {"site": arguments.site, "connect": session, "encoding": arguments.encoding, "batch_s": None}
        options |= spool_settings(arguments)
        azimuth = Azimuth(math.radians(arguments.azimuth_std), arguments.mirrored)
        many = ManyTags(arguments.tag or "", options, arguments.as_anchor, names, mounted, log, azimuth)
        stack.callback(many.close)
        stack.enter_context(Upkeep(many.clients))
        yield many


def _module(arguments: argparse.Namespace) -> Module | None:
    """Return the module that the options name or describe, None to find out. Raises ValueError."""
    name = arguments.module
    if arguments.pattern:
        if name != _AUTO:
            raise ValueError("--pattern describes the module: leave out --module")
        from dropanchor_tag_client.sources.modules.patterns.files import module_of_patterns

        return module_of_patterns(arguments.pattern)
    if name == _AUTO:
        return None
    if not name.endswith(SUFFIX):
        return MODULES[name]
    from dropanchor_tag_client.sources.modules.patterns.files import module_of_file

    return module_of_file(Path(name))


def _module_name(text: str) -> str:
    if text != _AUTO and text not in MODULES and not text.endswith(SUFFIX):
        hint = did_you_mean(text, MODULES) or f"; there are {', '.join(MODULES)}, and files NAME{SUFFIX}"
        raise argparse.ArgumentTypeError(f"no module is called {text}{hint}")
    return text


def _check(arguments: argparse.Namespace) -> None:
    if arguments.tag is None and not arguments.tag_from_id:
        raise ValueError("whose ranges are these? --tag says so, or --credentials, or --tag-from-id")
    if arguments.as_anchor is not None and not arguments.tag_from_id:
        raise ValueError("--as-anchor needs --tag-from-id")
    if not 0.0 < arguments.azimuth_std < 180.0:
        raise ValueError("--azimuth-std is an angle in degrees, such as 5")
    mounting(arguments.forward, arguments.up)
    anchor_names(arguments)

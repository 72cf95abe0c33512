"""An IMU chip on I²C is a tag's IMU."""

import argparse
import sys
import time
from functools import partial

from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.options import (
    add_calibration_option,
    add_connection_options,
    add_spool_options,
    opened_client,
)
from dropanchor_tag_client.sources.axes import AXES, Mounting, UpAxis, direction, mounting
from dropanchor_tag_client.sources.chips import CHIPS, Readings, open_chip
from dropanchor_tag_client.sources.self_test import self_test
from dropanchor_tag_client.sources.throttled_log import throttled_log

_LOG_INTERVAL_S = 10.0


def add_chip_arguments(parser: argparse.ArgumentParser, *, required: bool) -> None:
    parser.add_argument("--device", choices=list(CHIPS), required=required, help="the chip")
    parser.add_argument("--bus", type=int, default=1, help="/dev/i2c-<BUS> (default: %(default)s)")
    parser.add_argument(
        "--address", type=lambda text: int(text, 0), help="on the bus, such as 0x29 (default: that of Adafruit's board)"
    )
    parser.add_argument("--rate", type=_rate, default=100.0, metavar="HZ", help="samples per second (default: 100)")
    parser.add_argument(
        "--forward", choices=AXES, default="x", help="the axis that points forward; --forward=-y (default: %(default)s)"
    )
    parser.add_argument("--up", choices=AXES, default="z", help="the axis that points up (default: %(default)s)")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_chip_arguments(parser, required=True)
    parser.add_argument("--tag", help="id of the tag (default: the one of --credentials)")
    parser.add_argument("--self-test", action="store_true", help="say which axis points where, and publish nothing")
    add_connection_options(parser)
    add_spool_options(parser)
    add_calibration_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Raises ChipError, ConnectError, ValueError. Runs until it is interrupted."""
    mounted = mounting(arguments.forward, arguments.up)
    if arguments.tag is None and not arguments.self_test:
        raise ValueError("no tag was given: add --tag or --credentials")
    readings = opened_readings(arguments)
    if arguments.self_test:
        options = self_test(readings, arguments.rate, _print)
        sys.stdout.write(f"{options}\n")
        return 0
    with opened_client(arguments, arguments.tag) as client:
        try:
            publish(readings, client, mounted)
        finally:
            sys.stderr.write(f"{client.sent.samples} samples published{_left_out(readings)}\n")
    return 0


def opened_readings(arguments: argparse.Namespace) -> Readings:
    """Return the readings of the chip that the options name. Raises ChipError."""
    opened = partial(open_chip, arguments.device, arguments.bus, arguments.address)
    return Readings(opened, arguments.rate, throttled_log())


def publish(readings: Readings, client: TagClient, mounted: Mounting) -> None:
    """Publish every reading of the chip until the program is interrupted."""
    up_axis, log, next_log_s = UpAxis(), throttled_log(), time.monotonic() + _LOG_INTERVAL_S
    logged = 0
    for reading in readings:
        mag = None if reading.mag is None else mounted.to_body(reading.mag)
        client.publish_imu(mounted.to_body(reading.acc), mounted.to_body(reading.gyro), mag, t_ns=reading.t_ns)
        up = up_axis.add(reading.acc)
        if up is not None and mounted.up != direction(up):
            log(f"gravity says that axis {up} of the chip points up: start again with --up={up}")
        if time.monotonic() > next_log_s and readings.dropped.total() > logged:
            logged, next_log_s = readings.dropped.total(), time.monotonic() + _LOG_INTERVAL_S
            log(f"{client.sent.samples} samples published{_left_out(readings)}")


def _left_out(readings: Readings) -> str:
    counts = ", ".join(f"{reason.value} {count}" for reason, count in sorted(readings.dropped.items()))
    return f"; left out: {counts}" if counts else ""


def _print(text: str) -> None:
    sys.stderr.write(f"{text}\n")


def _rate(text: str) -> float:
    rate = float(text)
    if not 1 <= rate <= 1000:
        raise argparse.ArgumentTypeError(f"{text} is not between 1 and 1000")
    return rate

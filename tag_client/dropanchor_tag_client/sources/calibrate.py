"""Calibrate the IMU of a tag: rest, turns and figures of eight, from a chip or from lines on standard input."""

import argparse
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dropanchor_schemas.wire import ImuSample
from dropanchor_tag_client.calibration import Calibration, write_calibration
from dropanchor_tag_client.sources.axes import mounting
from dropanchor_tag_client.sources.calibration_fit import fit
from dropanchor_tag_client.sources.guidance import Guide
from dropanchor_tag_client.sources.imu import add_chip_arguments, opened_readings
from dropanchor_tag_client.sources.publish import BadLineError, imu_of

_LINES = 'lines on standard input, such as {"acc": [0, 0, 9.81], "gyro": [0, 0, 0.1], "mag": [0, 20, -44]}'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER", help="folder of the tag, such as the one from `dropanchor tag add`"
    )
    add_chip_arguments(parser, required=False)
    parser.set_defaults(credentials=None, site=None, connect=None)


def run(arguments: argparse.Namespace) -> int:
    """Calibrate and write the file. Raises ChipError, NotEnoughError, BadLineError, and ValueError for the folder."""
    if arguments.device is None:
        stream, source = samples_of_lines(sys.stdin.buffer), _LINES
    else:
        stream, source = _samples_of_chip(arguments), f"the {arguments.device} on I²C bus {arguments.bus}"
    found = fit(Guide(source).collect(stream))
    try:
        path = write_calibration(arguments.folder, found)
    except OSError as error:
        raise ValueError(f"{arguments.folder} cannot be written: {error.strerror}") from error
    sys.stderr.write(f"{path}: {described(found)}\n")
    return 0


def samples_of_lines(lines: BinaryIO) -> Iterator[ImuSample]:
    """Yield the IMU samples of lines as `publish` takes them. Raises BadLineError with the number of the line."""
    for number, line in enumerate(lines, start=1):
        if line.isspace():
            continue
        try:
            yield from imu_of(line)
        except BadLineError as error:
            raise BadLineError(f"line {number}: {error}") from None


def described(found: Calibration) -> str:
    """Return a sentence about a calibration."""
    degrees = ", ".join(f"{math.degrees(value):.2f}" for value in found.gyro_bias_radps)
    text = f"gyroscope bias {degrees} °/s, accelerometer scale {found.acc_scale:.4f}"
    if not found.has_mag:
        return f"{text}, no magnetometer"
    offset = ", ".join(f"{value:.1f}" for value in found.mag_offset_ut)
    values = np.linalg.eigvalsh(np.array(found.mag_matrix))
    return f"{text}, hard iron {offset} µT, soft iron {100 * (values[-1] / values[0] - 1):.0f} %"


def _samples_of_chip(arguments: argparse.Namespace) -> Iterator[ImuSample]:
    mounted = mounting(arguments.forward, arguments.up)
    for reading in opened_readings(arguments):
        mag = None if reading.mag is None else mounted.to_body(reading.mag)
        yield ImuSample(reading.t_ns, mounted.to_body(reading.acc), mounted.to_body(reading.gyro), mag)

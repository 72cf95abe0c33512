"""The options of `dropanchor replay`."""

import argparse
import math
from pathlib import Path
from typing import get_args

from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.commands.replay_output import FORMATS, VALUES
from dropanchor_tag_client.recording.columns import described

DESCRIPTION = """\
Runs the engine of the service on a recording, as fast as possible, and reports its error if the recording has a truth.
A recording is a folder with range.csv and anchors.csv, and optionally imu.csv, heading.csv and truth.csv. x and y are
in the coordinates of anchors.csv. `dropanchor import` makes recordings of other files.
A recording can also be an MCAP file from the service, or a folder of such files. All its tags then run with the site
and the settings of the recording; only --engine, --config and --out can be given.
"""
EPILOG = f"""\
{described()}
examples:
  dropanchor replay recordings/yard --anchor 1 --start=10,0,1.57
  dropanchor replay recordings/yard --anchor 1 --start=10,0 --tag-height 1.2 --range-std 0.1 --out poses.csv
  dropanchor replay recordings/yard --anchor 1 --start=10,0 --smooth --out track.parquet
  dropanchor replay yard-20270115T080000-000000Z.mcap --out poses.csv
  dropanchor-tag simulate --out recordings/yard      creates a recording with truth to try it on
"""
LAG_S, MAX_LAG_S = 2.0, 60.0
COLUMNS = ("t_s", *VALUES)
TAG_OPTIONS = {
    "start": "start",
    "height_m": "tag_height",
    "height_motion": "height_motion",
    "motion": "motion",
    "range_std_m": "range_std",
    "range_bias_m": "range_bias",
    "range_bias_std_m": "range_bias_std",
    "range_scale": "range_scale",
    "mount_angle_rad": "mount_angle",
    "mount_angle_std_rad": "mount_angle_std",
    "lever_forward_m": "lever_forward",
    "lever_left_m": "lever_left",
    "slip_std_rad": "slip_std",
    "heading_source": "heading",
    "heading_std_rad": "heading_std",
    "speed_max_mps": "speed_max",
    "acc_unit": "acc_unit",
    "acc_reversed": "acc_reversed",
    "gyro_unit": "gyro_unit",
    "range_unit": "range_unit",
    "reverse_allowed": "reverse",
}
"""The option that gives each setting of a tag."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("recording", type=Path, metavar="RECORDING", help="folder of the recording, or MCAP file")
    add(
        "--anchor",
        action="append",
        metavar="ID",
        help="use the ranges of this anchor; may be repeated; needed if the recording has several anchors",
    )
    _add_estimator(parser)
    _add_tag_settings(parser)
    _add_smoothing(parser)
    add(
        "--clock-offset",
        type=_seconds,
        metavar="S",
        help="the IMU's clock is so far ahead of the ranges'; 0: not at all (default: found from turns and stops)",
    )
    add("--config", type=Path, metavar="FILE", help="settings file of the service")
    _add_output(parser)


def _add_estimator(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--engine", metavar="NAME", help="estimator: fleet (default) or paper")
    add(
        "--start",
        type=_start,
        metavar="X,Y[,HEADING]",
        help="start of the tag: m, m, rad counter-clockwise from east (default: unknown)",
    )
    add(
        "--heading",
        choices=_choices("heading_source"),
        help="source of the heading: the IMU, or heading.csv (default: auto, the IMU if the recording has one)",
    )


def _add_output(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "--out",
        type=Path,
        metavar="FILE",
        help=f"write the poses to this file ({', '.join(FORMATS)}): {','.join(COLUMNS)}",
    )
    add("--plot", type=Path, metavar="PNG", help="write a picture of the track, with the truth if there is one")


def _add_tag_settings(parser: argparse.ArgumentParser) -> None:
    known = parser.add_argument_group(
        "settings of the tag (measured range = scale · distance + bias); without an option, that of [tag_defaults] and "
        "[site] in --config holds"
    )
    known.add_argument("--tag-height", type=float, metavar="M", help="on the z axis of anchors.csv (0)")
    known.add_argument("--height-motion", choices=_choices("height_motion"), help="what this height does (auto)")
    known.add_argument("--motion", choices=_choices("motion"), help="what moves the tag (auto)")
    known.add_argument("--range-std", type=float, metavar="M", help="standard deviation of one range")
    known.add_argument("--range-bias", type=float, metavar="M")
    known.add_argument("--range-bias-std", type=float, metavar="M", help="standard deviation of the bias; 0: exact")
    known.add_argument("--range-scale", type=float, metavar="K")
    known.add_argument("--mount-angle", type=float, metavar="RAD", help="direction of travel minus body x axis")
    known.add_argument("--mount-angle-std", type=float, metavar="RAD", help="standard deviation of that; 0: exact")
    known.add_argument(
        "--lever-forward",
        type=float,
        metavar="M",
        help="distance of the tag in front of the point that follows the course",
    )
    known.add_argument("--lever-left", type=float, metavar="M", help="distance to the left of that point")
    known.add_argument("--slip-std", type=float, metavar="RAD", help="standard deviation of the slip angle; 0: no slip")
    known.add_argument(
        "--heading-std", type=float, metavar="RAD", help="error of a platform heading that does not drift"
    )
    known.add_argument(
        "--declination", type=float, metavar="RAD", help="how far magnetic north is clockwise of the y axis (0)"
    )
    known.add_argument("--speed-max", type=float, metavar="M/S", help="top speed of the tag")
    known.add_argument("--acc-unit", choices=_choices("acc_unit"), help="of the accelerations (m/s2)")
    known.add_argument(
        "--acc-reversed", type=_yes_or_no, metavar="{yes,no}", help="accelerations have the opposite sign, as on iOS"
    )
    known.add_argument("--gyro-unit", choices=_choices("gyro_unit"), help="of the rates (rad/s)")
    known.add_argument("--range-unit", choices=_choices("range_unit"), help="of the ranges (m)")
    known.add_argument("--reverse", action="store_true", default=None, help="the tag may move backwards")


def _choices(field: str) -> tuple[str, ...]:
    return get_args(TagSettings.model_fields[field].annotation)


def _add_smoothing(parser: argparse.ArgumentParser) -> None:
    smoothing = parser.add_argument_group("smoothing (engine fleet): estimate each pose from later samples too")
    smoothing.add_argument("--smooth", action="store_true", help="use all samples of the recording")
    smoothing.add_argument(
        "--lag",
        type=_lag,
        nargs="?",
        const=LAG_S,
        metavar="S",
        help=f"with --smooth: use only samples up to S seconds after the pose ({LAG_S:g})",
    )


def _yes_or_no(text: str) -> bool:
    if text not in ("yes", "no"):
        raise argparse.ArgumentTypeError(f"{text!r} is neither yes nor no")
    return text == "yes"


def _start(text: str) -> StartPose:
    parts = text.split(",")
    if len(parts) not in (2, 3):
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y or X,Y,HEADING (m, m, rad)")
    try:
        x, y, *heading = (float(part) for part in parts)
        return StartPose(x=x, y=y, heading_rad=heading[0] if heading else None)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y or X,Y,HEADING (m, m, rad)") from error


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds") from error
    if not math.isfinite(seconds):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds")
    return seconds


def _lag(text: str) -> float:
    lag_s = _seconds(text)
    if not 0.0 <= lag_s <= MAX_LAG_S:
        raise argparse.ArgumentTypeError(f"{text} s is not within 0 and {MAX_LAG_S:g} s")
    return lag_s

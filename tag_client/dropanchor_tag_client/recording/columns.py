"""The files of a recording and their columns: the one place that lists them."""

import textwrap
from typing import NamedTuple

TIMES = {"t_ns": 1e9, "t_us": 1e6, "t_ms": 1e3, "t_s": 1.0}
"""Columns that may hold the time, and how many of their units are a second. The first that a file has is read."""


class Columns(NamedTuple):
    """One file of a recording.

    numbers: its columns of numbers without the time. text: its column of text. optional: columns that it may lack.
    interval_s: least and greatest interval between rows that is plausible. None: the rows have no time.
    """

    name: str
    holds: str
    meaning: str
    numbers: tuple[str, ...]
    text: str | None = None
    optional: tuple[str, ...] = ()
    may_be_nan: tuple[str, ...] = ()
    interval_s: tuple[float, float] | None = None
    is_required: bool = False


ANCHORS = Columns(
    "anchors",
    "anchors",
    "id, x, y, z: id and position of each anchor, m; z up",
    ("x", "y", "z"),
    text="id",
    is_required=True,
)
RANGE = Columns(
    "range",
    "ranges",
    "t_s, anchor_id, range_m, [std_m]: slant range to an anchor and its standard deviation, m",
    ("range_m", "std_m"),
    text="anchor_id",
    optional=("std_m",),
    interval_s=(2e-4, 20.0),
    is_required=True,
)
IMU = Columns(
    "imu",
    "IMU samples",
    "t_s, ax, ay, az, gx, gy, gz, [mx, my, mz]: specific force, m/s² (9.8 upwards at rest); angular rate, rad/s; "
    "magnetic field, µT; body axes x forward, y left, z up",
    ("ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz"),
    optional=("mx", "my", "mz"),
    interval_s=(2e-4, 1.5),
)
HEADING = Columns(
    "heading",
    "headings",
    "t_s, yaw_rad, [std_rad]: heading of the tag's platform and its standard deviation, rad counter-clockwise from x",
    ("yaw_rad", "std_rad"),
    optional=("std_rad",),
    may_be_nan=("yaw_rad",),
    interval_s=(2e-4, 5.0),
)
PRESSURE = Columns(
    "pressure",
    "pressures",
    "t_s, pressure_pa, [temperature_c]: pressure of the air at the tag, Pa, and the temperature of that air, °C",
    ("pressure_pa", "temperature_c"),
    optional=("temperature_c",),
    interval_s=(2e-3, 20.0),
)
TRUTH = Columns(
    "truth",
    "true poses",
    "t_s, x, y, [z], [yaw_rad]: true position of the tag, m, and its heading, rad",
    ("x", "y", "z", "yaw_rad"),
    optional=("z", "yaw_rad"),
    interval_s=(2e-4, 60.0),
)
FILES = (ANCHORS, RANGE, IMU, HEADING, PRESSURE, TRUTH)
FORMATS = (".csv", ".csv.gz", ".jsonl", ".jsonl.gz", ".parquet")
"""Endings of the files, in the order in which they are looked for."""


def described() -> str:
    """Return the files and columns of a recording for a help text."""
    lines = ["files of a recording (columns in brackets may be missing; other columns are ignored):"]
    for file in FILES:
        meaning = file.meaning + ("" if file.is_required else " (the file may be missing)")
        lines += textwrap.wrap(meaning, 112, initial_indent=f"  {file.name:9}", subsequent_indent=" " * 11)
    lines += textwrap.wrap(
        "Each is a table .csv or .jsonl, plain or gzipped (range.csv.gz), or .parquet (extra `parquet`). The time is "
        "t_s in seconds, t_ms in milliseconds, t_us or t_ns; since any instant, the same in all files.",
        112,
        initial_indent="  ",
        subsequent_indent="  ",
    )
    return "\n".join(lines) + "\n"

"""`dropanchor import`: turn bags, exports of apps and tables into a recording."""

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from dropanchor_service.importing.choice import Choice, Found
from dropanchor_service.importing.join import Joined, joined, merged
from dropanchor_service.importing.output import require_free, write_recording
from dropanchor_service.importing.readings import ImportingError, Position
from dropanchor_service.importing.report import report
from dropanchor_service.importing.sources import check_used, read_source
from dropanchor_service.importing.tables.mapping import ColumnMap, Fields, loaded, parsed, saved, words_of
from dropanchor_service.importing.verdicts import verdicts
from dropanchor_tag_client.sources.axes import AXES, mounting
from dropanchor_tag_client.sources.phones.pairing import Signs

DESCRIPTION = """\
Turns what you have into a recording: a folder with range.csv, imu.csv, heading.csv, pressure.csv and anchors.csv,
which `dropanchor replay` and `dropanchor-tag replay` read. It says what it decided, converts and leaves out.

A SOURCE is one of
  a bag of ROS             ROS 1 (.bag), ROS 2 (folder, .mcap, .db3): sensor_msgs/Imu, MagneticField, Range,
                           FluidPressure, and others with --map
  an MCAP file             with messages in JSON, or a recording of this service
  an export of a phone     Sensor Logger or phyphox: the folder, or the zip
  tables                   CSV, TSV, JSON, JSON Lines or Parquet: a file, a folder or a zip
Give several if the IMU and the ranges are in several.
"""
EPILOG = """\
--map says which column is what: FIELD=COLUMN, or FIELD=COLUMN:UNIT. Without it the names of the columns tell, and the
command prints the mapping that it guessed, to paste and correct.
  t                        s ms us ns min iso          without a unit the values tell
  ax ay az                 m/s2 g mg cm/s2             FIELD=-COLUMN turns an axis round
  gx gy gz                 rad/s deg/s mdeg/s rpm
  mx my mz                 uT nT mT T gauss mgauss
  range, std               m cm mm km ft in            std is its standard deviation
  anchor                                               the column with the id of the anchor
  range.ID                 as range                    a column with the ranges to the anchor ID
  heading, heading_std     rad deg deg_compass         counter-clockwise from east; deg_compass: clockwise from north
  pressure                 Pa hPa kPa                  of the air, from a barometer
  t_nsec                                               nanoseconds to add to t
What --map does not name is guessed all the same; FIELD= leaves it out.
A unit may have a number: ax=raw_x:g/16384. SOURCE/FIELD=… is for one table or topic: uwb.csv/t=time:ms.

examples:
  dropanchor import drive.mcap --out recordings/drive
  dropanchor import drive.bag --imu /imu/data --range /uwb/range=1 --anchor 1=0,0,2.5 --out recordings/drive
  dropanchor import imu.csv uwb.csv --out recordings/drive
  dropanchor import log.csv --out recordings/drive --map t=timestamp:ms ax=acc_x:g ay=acc_y:g az=acc_z:g \\
      gx=gyr_x:deg/s gy=gyr_y:deg/s gz=gyr_z:deg/s range=dist:cm anchor=id
  dropanchor import phone.zip uwb.csv --out recordings/walk
  dropanchor replay recordings/drive
"""
REFUSED = (ImportingError, ValueError, OSError)
EXIT_STOPPED = 130


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("sources", type=Path, nargs="+", metavar="SOURCE", help="file or folder to import; may be repeated")
    add("--out", type=Path, required=True, metavar="FOLDER", help="folder of the recording")
    add("--force", action="store_true", help="replace the recording in FOLDER")
    add("--without-imu", action="store_true", help="write a recording without IMU samples, too")
    add(
        "--anchor",
        type=_anchor,
        action="append",
        default=[],
        metavar="ID=X,Y,Z",
        help="position of an anchor, m; may be repeated (default: the only anchor is at 0,0,0)",
    )
    _add_tables(parser)
    _add_topics(parser)
    phone = parser.add_argument_group("phones and mountings")
    phone.add_argument(
        "--signs", choices=tuple(Signs), type=Signs, default=Signs.AUTO, help="which way accelerations of a phone point"
    )
    phone.add_argument("--forward", choices=AXES, help="axis of the IMU that points forward (default: x)")
    phone.add_argument("--up", choices=AXES, help="axis of the IMU that points up (default: z)")


def _add_tables(parser: argparse.ArgumentParser) -> None:
    tables = parser.add_argument_group("tables")
    tables.add_argument(
        "--map", nargs="+", action="extend", default=[], metavar="FIELD=COLUMN:UNIT", help="what the columns hold"
    )
    tables.add_argument(
        "--map-file", type=Path, metavar="FILE", help="read the mapping from this file; --map overrides"
    )
    tables.add_argument(
        "--save-map", type=Path, metavar="FILE", help="write the mapping that was used to this file (TOML)"
    )


def _add_topics(parser: argparse.ArgumentParser) -> None:
    topics = parser.add_argument_group("bags and MCAP files (without these, the only topic that fits is taken)")
    topics.add_argument("--imu", metavar="TOPIC", help="topic of the IMU")
    topics.add_argument("--mag", metavar="TOPIC", help="topic of the magnetometer")
    topics.add_argument(
        "--range",
        type=_range_topic,
        action="append",
        default=[],
        metavar="TOPIC=ANCHOR",
        help="topic with the ranges to this anchor; only TOPIC if its messages name the anchor; may be repeated",
    )
    topics.add_argument("--tag", help="tag whose samples are wanted, of a recording of this service")


def run(arguments: argparse.Namespace) -> int:
    """Import the sources. Return 0, or 130 on Ctrl-C. Raises REFUSED."""
    try:
        _import(arguments)
    except KeyboardInterrupt:
        print("stopped: nothing was written", file=sys.stderr)
        return EXIT_STOPPED
    return 0


def _import(arguments: argparse.Namespace) -> None:
    require_free(arguments.out, arguments.force)
    mounted = mounting(arguments.forward or "x", arguments.up or "z")
    columns = _columns(arguments)
    choice = Choice(columns, arguments.signs, arguments.imu, arguments.mag, tuple(arguments.range), arguments.tag)
    founds = [read_source(source, choice) for source in arguments.sources]
    check_used(columns, founds)
    readings = merged([(str(s), found.readings) for s, found in zip(arguments.sources, founds, strict=True)])
    samples = joined(readings, mounted if arguments.forward or arguments.up else None)
    _say([*readings.notes, *_guessed(founds)])
    if not len(samples.imu) and not len(samples.ranges) and not len(samples.headings):
        raise ImportingError("there is no reading left to write")
    if not len(samples.imu) and not len(samples.headings) and not arguments.without_imu:
        raise ImportingError(
            "there are no IMU samples, without which a replay finds no place. What is not used, and why, stands above; "
            "--map names columns. --without-imu writes the recording all the same"
        )
    anchors = _anchors(samples, dict(arguments.anchor))
    write_recording(arguments.out, samples, anchors)
    _save_map(arguments.save_map, founds)
    _say(["", *report(samples), *readings.left_out.sentences(), *_lacking(samples)])
    _say(verdicts(samples.imu, samples.ranges, readings.units))
    which = " --anchor ID" if len(anchors) > 1 else ""  # a replay asks for one
    _say(["", f"{arguments.out}: next, dropanchor replay {shlex.quote(str(arguments.out))}{which}"])


def _columns(arguments: argparse.Namespace) -> ColumnMap:
    columns = loaded(arguments.map_file) if arguments.map_file else ColumnMap()
    told = parsed(arguments.map)
    columns.general.update(told.general)
    for source, fields in told.of_source.items():
        columns.of_source.setdefault(source, {}).update(fields)
    return columns


def _guessed(founds: Sequence[Found]) -> list[str]:
    """Return the mapping that was guessed, as words to paste."""
    tables = {name: fields for found in founds for name, fields in found.guessed.items()}
    if not tables:
        return []
    words = [word for name in tables for word in words_of(tables[name], name if _clashes(name, tables) else None)]
    return ["guessed from the names of the columns:", "  --map " + " ".join(dict.fromkeys(words))]


def _clashes(name: str, tables: dict[str, Fields]) -> bool:
    """Return whether another table has another column for one of the fields."""
    others = [fields for other, fields in tables.items() if other != name]
    return any(other.get(field, column) != column for other in others for field, column in tables[name].items())


def _save_map(path: Path | None, founds: Sequence[Found]) -> None:
    if path is not None:
        tables = {name: fields for found in founds for name, fields in found.fields.items()}
        path.write_text(saved(tables))
        print(f"{path}: the mapping of {', '.join(tables)}; --map-file {shlex.quote(str(path))} uses it again")


def _anchors(samples: Joined, told: dict[str, Position]) -> dict[str, Position]:
    """Return the positions of all anchors. Raises ImportingError if they are not known."""
    ids = sorted(set(samples.ranges.anchors))
    known = samples.anchors | told
    if unknown := sorted(set(told) - set(ids) - set(samples.anchors)):
        raise ImportingError(f"--anchor {', '.join(unknown)}: there are ranges only to {', '.join(ids) or 'no anchor'}")
    missing = [name for name in ids if name not in known]
    if len(ids) > 1 and missing:
        counts = ", ".join(f"{name} ({samples.ranges.anchors.count(name)} ranges)" for name in missing)
        words = " ".join(f"--anchor {shlex.quote(name)}=X,Y,Z" for name in missing)
        raise ImportingError(f"the positions of the anchors {counts} are not known: give {words}")
    for name in missing or ([] if known else ["1"]):
        _say([f"anchor {name} is taken to be at 0,0,0 (--anchor {shlex.quote(name)}=X,Y,Z)"])
        known[name] = (0.0, 0.0, 0.0)
    return known


def _lacking(samples: Joined) -> list[str]:
    if len(samples.ranges):
        return [] if len(samples.imu) or len(samples.headings) else ["there is no IMU: a replay has no heading"]
    return ["there are no ranges: a replay finds no place. Give the source that has them, too"]


def _say(lines: Sequence[str]) -> None:
    for line in lines:
        print(line)


def _anchor(text: str) -> tuple[str, Position]:
    name, _, place = text.rpartition("=")
    try:
        x, y, z = map(float, place.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not ID=X,Y,Z (m)") from None
    if not name:
        raise argparse.ArgumentTypeError(f"{text!r} is not ID=X,Y,Z (m)")
    return name, (x, y, z)


def _range_topic(text: str) -> tuple[str, str | None]:
    topic, _, anchor = text.partition("=")
    if not topic:
        raise argparse.ArgumentTypeError(f"{text!r} is not TOPIC=ANCHOR")
    return topic, anchor or None

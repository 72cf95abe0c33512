"""Read a bag: its chosen topics as tables."""

from collections.abc import Mapping
from pathlib import Path

from dropanchor_service.importing.bags.bag import MAG, Bag
from dropanchor_service.importing.bags.choose import Chosen, choose, listed, tables_of
from dropanchor_service.importing.bags.mcap_bag import McapBag
from dropanchor_service.importing.bags.topic_table import STAMP, TopicTable
from dropanchor_service.importing.choice import Choice, Found
from dropanchor_service.importing.files import first_bytes
from dropanchor_service.importing.join import merged
from dropanchor_service.importing.readings import ImportingError, Readings
from dropanchor_service.importing.tables.mapping import ANCHOR, T_NSEC, VECTORS, WIDE, Column, T
from dropanchor_service.importing.tables.reading import fields_of, is_useful, readings_of, told_of
from dropanchor_service.recording.mcap_file import PROFILE

_IMU_FIELDS = {T, T_NSEC, *VECTORS["acc"], *VECTORS["gyro"]}
_RANGE_FIELDS = {T, T_NSEC, ANCHOR, "range", "std"}


def read_bag(path: Path, choice: Choice) -> Found:
    """Return what a bag or MCAP file holds. Raises ImportingError."""
    bag = _opened(path)
    if isinstance(bag, McapBag) and bag.profile == PROFILE:
        from dropanchor_service.importing.bags.own_mcap import read_own

        return Found(read_own(path, choice.tag))
    chosen = choose(bag, Chosen(choice.imu, choice.mag, list(choice.ranges)), path)
    extra = [name for name in choice.columns.of_source if name in {topic.name for topic in bag.topics}]
    tables = tables_of(bag, dict.fromkeys([*chosen.all, *extra]), path)
    found, parts = Found(Readings()), []
    for name, table in tables.items():
        fields = _fields(table, choice, chosen)
        if not is_useful(fields):
            raise ImportingError(
                f"{path}: no field of {name} is known as a reading: say with --map what they hold. It has "
                f"{', '.join(table.columns) or 'no message'}\n{listed(bag.topics)}"
            )
        parts.append((name, readings_of(table, fields)))
        found.fields[name] = fields
        found.told |= set(told_of(table, choice.columns.texts_for(name)))
    found.readings = merged(parts, of_one_bag=True)
    found.readings.notes = [f"{path.name}: {_summary(chosen)}", *chosen.notes, *found.readings.notes, *bag.notes]
    return found


def _opened(path: Path) -> Bag:
    """Open a file or folder. A folder without its metadata may have one file."""
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        files = sorted([*path.glob("*.mcap"), *path.glob("*.db3")])
        if len(files) > 1:
            raise ImportingError(f"{path} has several bags and no metadata.yaml: import {files[0]} or another one")
        path = files[0]
    if path.is_file() and first_bytes(path, 1) == b"\x89":
        return McapBag(path)
    from dropanchor_service.importing.bags.ros_bag import RosBag

    return RosBag(path)


def _fields(table: TopicTable, choice: Choice, chosen: Chosen) -> dict[str, Column]:
    """Return the columns of a topic: those told for it, or of all told ones those of its role, or else guessed."""
    own = choice.columns.of_source.get(table.name, {})
    told = {name: text for name, text in choice.columns.general.items() if name in _wanted(table.name, chosen)} | own
    fields = fields_of(table, told)
    fields = {name: column for name, column in fields.items() if name in own or name in _wanted(table.name, chosen)}
    if T not in told:
        fields.pop(T_NSEC, None)
        fields = {T: Column(STAMP, "ns")} | {name: column for name, column in fields.items() if name != T}
    return _with_units(_with_anchor(fields, dict(chosen.ranges).get(table.name)), table.kind)


def _wanted(topic: str, chosen: Chosen) -> "_Wanted":
    ranges = any(name == topic for name, _ in chosen.ranges)
    return _Wanted(topic == chosen.imu, chosen.mag in (topic, None), ranges, topic == chosen.pressure)


class _Wanted:
    """The fields that a topic is read for."""

    def __init__(self, imu: bool, mag: bool, ranges: bool, pressure: bool) -> None:
        self._names = (_IMU_FIELDS if imu else set()) | (_RANGE_FIELDS if ranges else set())
        self._names |= {T, T_NSEC, *VECTORS["mag"]} if mag else set()
        self._names |= {T, T_NSEC, *VECTORS["pressure"]} if pressure else set()
        self._wide = ranges

    def __contains__(self, name: str) -> bool:
        return name in self._names or (self._wide and name.startswith(WIDE))


def _with_anchor(fields: Mapping[str, Column], anchor: str | None) -> dict[str, Column]:
    """Return the fields of ranges to one anchor that was told."""
    if anchor is None:
        return dict(fields)
    return {f"{WIDE}{anchor}" if name == "range" else name: column for name, column in fields.items() if name != ANCHOR}


def _with_units(fields: Mapping[str, Column], kind: str) -> dict[str, Column]:
    """Return the fields with the units that ROS defines for the messages of sensor_msgs."""
    if not kind.startswith("sensor_msgs/"):
        return dict(fields)
    units = dict.fromkeys(VECTORS["acc"], "m/s2") | dict.fromkeys(VECTORS["gyro"], "rad/s")
    units |= dict.fromkeys(VECTORS["mag"], "T" if kind == MAG else "uT") | {"range": "m", "std": "m", "pressure": "Pa"}
    return {
        name: column if column.unit or name in (T, ANCHOR) else Column(column.name, units.get(name, "m"), column.sign)
        for name, column in fields.items()
    }


def _summary(chosen: Chosen) -> str:
    ranges = [f"--range {topic}{f'={anchor}' if anchor else ''}" for topic, anchor in chosen.ranges]
    words = [
        *([f"--imu {chosen.imu}"] if chosen.imu else []),
        *([f"--mag {chosen.mag}"] if chosen.mag else []),
        *ranges,
    ]
    return f"uses {' '.join(words)}"

"""Join what the sources hold: accelerations and fields at the times of the gyroscope, and all on one clock."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.readings import (
    Headings,
    ImportingError,
    Position,
    Ranges,
    Readings,
)
from dropanchor_service.importing.streams import Stream
from dropanchor_tag_client.sources.axes import Mounting
from dropanchor_tag_client.sources.phones.pairing import MAX_GAP_NS

NS_PER_S = 1_000_000_000
_DAY_NS = 86_400 * NS_PER_S
_KEPT_NS = 1000 * NS_PER_S  # times below are from a start, and stay as they are


@dataclass(frozen=True)
class Imu:
    """IMU samples in the axes of the tag. t_ns: (n,). acc, gyro, mag: (n, 3), m/s², rad/s, µT (NaN: none)."""

    t_ns: Array
    acc: Array
    gyro: Array
    mag: Array

    def __len__(self) -> int:
        return len(self.t_ns)


@dataclass(frozen=True)
class Joined:
    """All readings. t0_ns: what was subtracted from their times, to count them from there."""

    imu: Imu
    ranges: Ranges
    headings: Headings
    pressures: Stream
    truth: Stream
    anchors: dict[str, Position]
    t0_ns: int


def merged(parts: Sequence[tuple[str, Readings]], of_one_bag: bool = False) -> Readings:
    """Return the readings of all sources, each with its name. Raises ImportingError where two hold the same.

    of_one_bag: they are topics that were chosen, on one clock, and may have ranges to the same anchor.
    """
    whole = Readings()
    for source, part in parts:
        for sensor in _NAMES:
            stream = getattr(part, sensor)
            if len(stream) and len(getattr(whole, sensor)):
                raise ImportingError(
                    f"{source} has a second {_NAMES[sensor]}: import it alone, or leave it out with --map"
                )
            if len(stream):
                setattr(whole, sensor, stream)
        if not of_one_bag:
            _require_apart(whole, part, source)
        whole.ranges = _both_ranges(whole.ranges, part.ranges)
        whole.headings = _both_headings(whole.headings, part.headings)
        whole.anchors |= part.anchors
        whole.notes += part.notes
        whole.left_out.add_all(part.left_out)
        whole.units |= part.units
    return whole


_NAMES = {"acc": "accelerometer", "gyro": "gyroscope", "mag": "magnetometer", "pressure": "barometer", "truth": "truth"}


def joined(readings: Readings, mounted: Mounting | None = None) -> Joined:
    """Return the samples. mounted: how the axes of the IMU lie in the tag; None: they are the tag's."""
    imu = _imu(readings)
    if mounted is not None:
        rotation = np.array(mounted, np.float64).T
        imu = Imu(imu.t_ns, imu.acc @ rotation, imu.gyro @ rotation, imu.mag @ rotation)
    times = [kind.t_ns for kind in (imu, readings.ranges, readings.headings, readings.pressure) if len(kind)]
    first_ns = min((int(t_ns[0]) for t_ns in times), default=0)
    _require_one_clock(
        {"IMU": imu.t_ns, "ranges": readings.ranges.t_ns, "headings": readings.headings.t_ns}
        | {"pressures": readings.pressure.t_ns, "truth": readings.truth.t_ns}
    )
    t0_ns = first_ns // NS_PER_S * NS_PER_S if not 0 <= first_ns < _KEPT_NS else 0
    ranges, headings = readings.ranges, readings.headings
    return Joined(
        Imu(imu.t_ns - t0_ns, imu.acc, imu.gyro, imu.mag),
        Ranges(ranges.t_ns - t0_ns, ranges.anchors, ranges.range_m, ranges.std_m),
        Headings(headings.t_ns - t0_ns, headings.yaw_rad, headings.std_rad),
        Stream(readings.pressure.t_ns - t0_ns, readings.pressure.values),
        Stream(readings.truth.t_ns - t0_ns, readings.truth.values),
        readings.anchors,
        t0_ns,
    )


def _require_one_clock(sensors: Mapping[str, Array]) -> None:
    """Raise ImportingError for sensors that are days apart: a replay would run through all of them."""
    spans = [(int(t_ns[0]), int(t_ns[-1]), name) for name, t_ns in sensors.items() if len(t_ns)]
    for (_, end, before), (start, _, after) in pairwise(sorted(spans)):
        if start - end > _DAY_NS:
            raise ImportingError(
                f"the times of the {before} end {(start - end) / _DAY_NS:.0f} days before those of the {after} begin: "
                "they are not of one clock, or not in the unit that was taken. Say the unit with --map t=COLUMN:UNIT "
                "(s, ms, us, ns), or record both with one clock"
            )


def _imu(readings: Readings) -> Imu:
    """Return the samples at the times of the gyroscope that have an acceleration."""
    gyro = readings.gyro
    if not len(gyro) or not len(readings.acc):
        _say_what_lacks(readings)
        return Imu(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3)))
    acc, usable = readings.acc.at(gyro.t_ns, MAX_GAP_NS)
    readings.left_out.add("IMU", "turn rates without an acceleration at their time", count=int((~usable).sum()))
    mag = _field(readings.mag, gyro.t_ns)
    return Imu(gyro.t_ns[usable], acc[usable], gyro.values[usable], mag[usable])


def _say_what_lacks(readings: Readings) -> None:
    for name, has, lacks in (
        ("gyroscope", readings.acc, readings.gyro),
        ("accelerometer", readings.gyro, readings.acc),
    ):
        if len(has) and not len(lacks):
            readings.notes.append(f"no column is known as that of a {name}: without it the IMU is left out")


def _field(mag: Stream, t_ns: Array) -> Array:
    values, usable = mag.at(t_ns, MAX_GAP_NS)
    return np.where(usable[:, None], values, np.nan)


def _require_apart(a: Readings, b: Readings, source: str) -> None:
    """Raise ImportingError for what two sources measured at the same time: a clock began anew, or one is a copy."""
    pairs = {"headings": (a.headings.t_ns, b.headings.t_ns)}
    for anchor in sorted(set(a.ranges.anchors) & set(b.ranges.anchors)):
        pairs[f"ranges to {anchor}"] = _to(anchor, a.ranges), _to(anchor, b.ranges)
    for what, (one, other) in pairs.items():
        if len(one) and len(other) and one[0] <= other[-1] and other[0] <= one[-1]:
            raise ImportingError(
                f"{source} and another source have {what} at the same time. If a clock was set or a device started "
                "anew, import them one by one; leave out a copy; say which anchor is which with --map range.ID=COLUMN"
            )


def _to(anchor: str, ranges: Ranges) -> Array:
    t_ns: Array = ranges.t_ns[np.array([name == anchor for name in ranges.anchors])]
    return t_ns


def _both_ranges(a: Ranges, b: Ranges) -> Ranges:
    t_ns, anchors = np.concatenate([a.t_ns, b.t_ns]), (*a.anchors, *b.anchors)
    order = np.argsort(t_ns, kind="stable")
    names = tuple(anchors[i] for i in order.tolist())
    range_m, std_m = (np.concatenate(pair)[order] for pair in ((a.range_m, b.range_m), (a.std_m, b.std_m)))
    return Ranges(t_ns[order], names, range_m, std_m)


def _both_headings(a: Headings, b: Headings) -> Headings:
    order = np.argsort(np.concatenate([a.t_ns, b.t_ns]), kind="stable")
    return Headings(*(np.concatenate([getattr(a, f.name), getattr(b, f.name)])[order] for f in fields(Headings)))

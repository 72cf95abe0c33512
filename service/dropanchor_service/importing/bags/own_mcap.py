"""Recordings of this service: the samples of one of their tags, as the tag sent them."""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TypeVar

import numpy as np

from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.site import Site
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, Rejection, anchor_number, decode_packed
from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.readings import (
    ACC,
    GYRO,
    MAG,
    RANGE,
    ImportingError,
    Readings,
    Unit,
    headings_of,
    ranges_of,
    stream_of,
)
from dropanchor_service.recording.reading import RecordingReader
from dropanchor_tag_client.recording.recording import Rows

S = TypeVar("S")

Arrived = tuple[Frame, int]
"""A message, and UTC of its arrival in ns."""


def read_own(path: Path, tag: str | None) -> Readings:
    """Return the samples of a tag of a recording. Raises ImportingError, RecordingError.

    tag: None for the only one.
    """
    reader, readings = RecordingReader(path), Readings()
    by_tag: dict[str, list[Arrived]] = {}
    site: Site | None = None
    for turn in reader.turns():
        site = turn.site.site if turn.site is not None else site
        for name, payload, encoding, arrived_ns in turn.messages:
            frame = decode_packed(payload) if encoding == ENCODING_PACKED else decode_json(payload)
            if isinstance(frame, Rejection):
                readings.left_out.add(path.name, f"messages of {name} that are {frame.reason}")
            else:
                by_tag.setdefault(name, []).append((frame, arrived_ns))
    if reader.read_error is not None:
        readings.notes.append(f"{path.name} is cut off or damaged ({reader.read_error}): it is used up to there")
    chosen = _chosen(path, by_tag, tag)
    frames = list(_on_utc(_in_sequence(by_tag[chosen]), readings, path.name))
    _fill(readings, frames, path.name, _names(site, frames))
    readings.anchors = {a.id: (a.x, a.y, a.z) for a in site.anchors} if site is not None else {}
    readings.notes.insert(0, f"{path.name}: a recording of this service, tag {chosen}")
    readings.units = {ACC: Unit("m/s2"), GYRO: Unit("rad/s"), MAG: Unit("uT"), RANGE: Unit("m")}
    return readings


def _chosen(path: Path, by_tag: dict[str, list[Arrived]], tag: str | None) -> str:
    tags = ", ".join(f"{name} ({len(frames)} messages)" for name, frames in sorted(by_tag.items()))
    if not by_tag:
        raise ImportingError(f"{path} has no samples of any tag")
    if tag is None and len(by_tag) == 1:
        return next(iter(by_tag))
    if tag is None:
        raise ImportingError(f"{path} has several tags, choose one with --tag: {tags}")
    if tag not in by_tag:
        raise ImportingError(f"{path} has no tag {tag}; it has {tags}")
    return tag


def _in_sequence(arrived: Sequence[Arrived]) -> Iterator[Arrived]:
    """Yield each message once, since a tag sends some again, and those of a publisher in the order of their numbers."""
    distinct: dict[tuple[int, int], Arrived] = {}
    for place, (frame, t_ns) in enumerate(arrived):  # without a number in the order of their arrival
        numbered = frame.boot_id and frame.sequence is not None
        number = (frame.boot_id or 0, frame.sequence or 0) if numbered else (0, place)
        distinct.setdefault(number, (frame, t_ns))
    in_order: dict[int, Iterator[tuple[int, int]]] = {}
    for boot_id, numbers in groupby(sorted(distinct), key=itemgetter(0)):
        in_order[boot_id] = iter(list(numbers))
    for boot_id, _ in distinct:
        yield distinct[next(in_order[boot_id])]


def _on_utc(arrived: Iterator[Arrived], readings: Readings, source: str) -> Iterator[Frame]:
    """Yield the frames with their times on UTC: a clock since boot is set by the message that took least to arrive."""
    frames = list(arrived)
    offsets: dict[int | None, int] = {}
    for frame, arrived_ns in frames:
        times = frame.times()
        if frame.boot_clock and times:
            offset = arrived_ns - max(times)
            offsets[frame.boot_id] = min(offset, offsets.get(frame.boot_id, offset))
    if offsets:
        readings.notes.append(f"{source}: the times since boot are set to UTC by their arrival")
    for frame, _ in frames:
        yield _shifted(frame, offsets[frame.boot_id]) if frame.boot_clock and frame.times() else frame


def _shifted(frame: Frame, offset_ns: int) -> Frame:
    lists = {
        kind.field: [sample._replace(t_ns=sample.t_ns + offset_ns) for sample in samples]
        for kind, samples in frame.by_kind()
    }
    return frame.replaced(**lists)


def _names(site: Site | None, frames: Sequence[Frame]) -> dict[int, str]:
    """Return the ids of anchors by the number that stands in messages."""
    names = {anchor_number(anchor.id): anchor.id for anchor in site.anchors} if site is not None else {}
    return {number: name for frame in frames for number, name in frame.anchor_names.items()} | names


def _fill(readings: Readings, frames: Sequence[Frame], source: str, names: dict[int, str]) -> None:
    left_out = readings.left_out
    for name in ("acc", "gyro", "mag"):
        imu, rows = _flat(([s for s in frame.imu if getattr(s, name) is not None] for frame in frames), source)
        vectors = np.array([getattr(sample, name) for sample in imu])
        setattr(readings, name, stream_of(_times(imu), vectors, rows, name, left_out))
    ranges, rows = _flat((frame.ranges for frame in frames), source)
    anchors = [names.get(sample.anchor, str(sample.anchor)) for sample in ranges]
    columns = (np.array([sample.range_m for sample in ranges]), np.array([sample.std_m for sample in ranges]))
    readings.ranges = ranges_of(_times(ranges), anchors, columns, rows, left_out)
    headings, rows = _flat((frame.headings for frame in frames), source)
    columns = (np.array([sample.heading_rad for sample in headings]), np.array([sample.std_rad for sample in headings]))
    readings.headings = headings_of(_times(headings), columns, rows, left_out)
    pressures, rows = _flat((frame.pressures for frame in frames), source)
    air = np.array([(sample.pressure_pa, sample.temperature_c) for sample in pressures]).reshape(-1, 2)
    readings.pressure = stream_of(_times(pressures), air, rows, "pressures", left_out)
    count = sum(len(frame.bearings) for frame in frames)
    left_out.add(source, "bearings: a recording folder has none", count=count)


def _flat(lists: Iterable[Sequence[S]], source: str) -> tuple[list[S], Rows]:
    """Return all samples, and the numbers of their messages."""
    found = [(number, sample) for number, samples in enumerate(lists, 1) for sample in samples]
    return [sample for _, sample in found], Rows(source, "message", array("q", (number for number, _ in found)))


def _times(samples: Sequence[object]) -> Array:
    return np.array([sample.t_ns for sample in samples], np.int64)  # type: ignore[attr-defined]

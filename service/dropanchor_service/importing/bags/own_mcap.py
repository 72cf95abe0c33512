"""Recordings of this service: the samples of one of their tags, as the tag sent them."""

from collections.abc import Iterator, Sequence
from pathlib import Path

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
    frames = list(_on_utc(_distinct(by_tag[chosen]), readings, path.name))
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


def _distinct(frames: Sequence[Arrived]) -> Iterator[Arrived]:
    """Yield each message once: a tag sends some again."""
    known = set()
    for frame, arrived_ns in frames:
        number = (frame.boot_id, frame.sequence)
        if not frame.boot_id or frame.sequence is None or number not in known:
            known.add(number)
            yield frame, arrived_ns


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
    imu = [sample for frame in frames for sample in frame.imu]
    t_ns = _times(imu)
    for name in ("acc", "gyro"):
        vectors = np.array([getattr(sample, name) for sample in imu])
        setattr(readings, name, stream_of(t_ns, vectors, source, name, readings.left_out))
    with_field = [sample for sample in imu if sample.mag is not None]
    values = np.array([sample.mag for sample in with_field])
    readings.mag = stream_of(_times(with_field), values, source, "mag", readings.left_out)
    ranges = [sample for frame in frames for sample in frame.ranges]
    anchors = [names.get(sample.anchor, str(sample.anchor)) for sample in ranges]
    columns = (np.array([sample.range_m for sample in ranges]), np.array([sample.std_m for sample in ranges]))
    readings.ranges = ranges_of(_times(ranges), anchors, *columns)
    headings = [sample for frame in frames for sample in frame.headings]
    readings.headings = headings_of(
        _times(headings), np.array([h.heading_rad for h in headings]), np.array([h.std_rad for h in headings])
    )
    pressures = [sample for frame in frames for sample in frame.pressures]
    air = np.array([(sample.pressure_pa, sample.temperature_c) for sample in pressures]).reshape(-1, 2)
    readings.pressure = stream_of(_times(pressures), air, source, "pressures", readings.left_out)
    count = sum(len(frame.bearings) for frame in frames)
    readings.left_out.add(source, "bearings: a recording folder has none", count=count)


def _times(samples: Sequence[object]) -> Array:
    return np.array([sample.t_ns for sample in samples], np.int64)  # type: ignore[attr-defined]

"""Prepare the samples of a recording for an engine: the one place that all of them pass.

The reader has put the times in seconds and in order. Here the values are screened as live, then each of the checks
below may leave out or correct samples, and says so.
"""

from array import array
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dropanchor_service.estimation.columns import Array, SampleBatch
from dropanchor_service.offline.clock_offset import is_large, motion_offset
from dropanchor_service.offline.replay import NS_PER_S, Samples, samples_of
from dropanchor_tag_client.recording import Recording, RecordingError

_SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Checked:
    """Samples that may be used, and sentences on the others and on corrections."""

    batch: SampleBatch
    sentences: list[str]


Check = Callable[[SampleBatch], Checked]


@dataclass(frozen=True)
class Prepared:
    """Samples for the engine, and sentences for the summary."""

    samples: Samples
    sentences: list[str]


def prepared(recording: Recording, anchors: list[str], clock_offset_s: float | None = None) -> Prepared:
    """Return what an engine gets of a recording. Raises RecordingError.

    clock_offset_s: how far the clock of the motion is ahead of that of the ranges; None: look for it.
    """
    samples = samples_of(recording, anchors)
    checks: tuple[Check, ...] = (partial(with_one_clock, given_s=clock_offset_s),)
    sentences = [*recording.notes]
    for check in checks:
        checked = check(samples.batch)
        samples = replace(samples, batch=checked.batch)
        sentences += checked.sentences
    return Prepared(_from_zero(samples), sentences)


def with_units(recording: Recording, settings: Array) -> Recording:
    """Return the recording in m/s², rad/s and m. settings: TAG_SETTINGS (0-d) with the factors of what it has."""
    of_imu = dict.fromkeys(("ax", "ay", "az"), "acc_factor") | dict.fromkeys(("gx", "gy", "gz"), "gyro_factor")
    imu = {name: _times(column, settings, of_imu.get(name)) for name, column in recording.imu.items()}
    of_ranges = dict.fromkeys(("range_m", "std_m"), "range_factor")
    ranges = {name: _times(column, settings, of_ranges.get(name)) for name, column in recording.ranges.items()}
    return replace(recording, imu=imu, ranges=ranges)


def _times(column: "array[float]", settings: Array, factor: str | None) -> "array[float]":
    """Return a column times one of the factors of a tag, the column itself where that is 1."""
    if factor is None or settings[factor] == 1.0:
        return column
    return array("d", (np.asarray(column) * float(settings[factor])).tobytes())


def _from_zero(samples: Samples) -> Samples:
    """Return samples whose times are not negative: engines count from 1970, or from the start of a device."""
    columns = samples.batch.columns()
    first_ns = min((int(column["t_ns"][0]) for column in columns if len(column)), default=0)
    if first_ns >= 0:
        return samples
    zero_ns = first_ns // _SECOND_NS * _SECOND_NS
    moved = [column.copy() for column in columns]
    for column in moved:
        column["t_ns"] -= zero_ns
    return replace(samples, batch=SampleBatch(*moved), zero_ns=zero_ns)


def with_one_clock(batch: SampleBatch, given_s: float | None) -> Checked:
    """Move the motion to the clock of the ranges: by the given offset, or by one that the motion shows for certain."""
    if given_s is not None:
        return _moved(batch, given_s, f"moved as --clock-offset {given_s:g} says") if given_s else Checked(batch, [])
    found = motion_offset(batch)
    if found is None or not is_large(found):
        return Checked(batch, [])
    return _moved(batch, found.offset_s, "corrected; --clock-offset 0 switches this off")


def _moved(batch: SampleBatch, ahead_s: float, what: str) -> Checked:
    """Subtract the offset from the times of the IMU, or of the headings where there is no IMU."""
    name, whose = ("imu", "IMU") if len(batch.imu) else ("headings", "platform")
    column = getattr(batch, name).copy()
    if not len(column):
        raise RecordingError("--clock-offset moves the IMU or the headings, but the recording has neither")
    column["t_ns"] -= int(np.rint(ahead_s * NS_PER_S))
    direction = "ahead of" if ahead_s > 0 else "behind"
    sentence = f"the {whose}'s clock is {abs(ahead_s):.1f} s {direction} the ranges': {what}"
    return Checked(replace(batch, **{name: column}), [sentence])

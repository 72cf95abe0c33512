"""The kinds of samples: the one place that lists them. This module needs only the standard library.

It has no dataclasses: importing them costs a tag 1.2 MB of memory.

The codecs, the ingest, the counters and the recording take what they need to know about a kind from `KINDS`. To add a
kind, add its sample class, its row of `SCALARS` and its list in `Frame`.
"""

import math
import struct
from collections.abc import Iterator
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple

from dropanchor_schemas.rejections import Reason

Vector = tuple[float, float, float]
_NO_FIELD = (math.nan, math.nan, math.nan)


class ImuSample(NamedTuple):
    """One IMU sample; body frame x forward, y left, z up.

    acc: specific force, m/s². gyro: angular rate, rad/s. mag: magnetic field, µT; None without a magnetometer.
    """

    t_ns: int
    acc: Vector
    gyro: Vector
    mag: Vector | None = None


class RangeSample(NamedTuple):
    """Slant range to the anchor with this number, m. std_m: standard deviation, NaN if unknown."""

    t_ns: int
    anchor: int
    range_m: float
    std_m: float = math.nan


class HeadingSample(NamedTuple):
    """Heading from the tag's platform, counter-clockwise from east, rad. std_rad: NaN if unknown."""

    t_ns: int
    heading_rad: float
    std_rad: float = math.nan


class BearingSample(NamedTuple):
    """Bearing of the tag seen from the anchor, counter-clockwise from east, rad. std_rad: NaN if unknown."""

    t_ns: int
    anchor: int
    bearing_rad: float
    std_rad: float = math.nan


class PressureSample(NamedTuple):
    """Pressure of the air at the tag, Pa. temperature_c: of that air, °C, NaN if unknown."""

    t_ns: int
    pressure_pa: float
    temperature_c: float = math.nan


Sample = ImuSample | RangeSample | HeadingSample | BearingSample | PressureSample


class _Kind:
    """One kind of sample.

    name: its name in JSON, counters and metrics. field: the attribute of a `Frame` that holds its samples.
    sample: its class. value: the field of a sample that tells the kind.
    """

    def __init__(self, name: str, field: str, sample: type[Any]) -> None:
        self.name, self.field, self.sample = name, field, sample

    @cached_property
    def value(self) -> str:
        names: tuple[str, ...] = self.sample._fields
        return next(name for name in names if name not in ("t_ns", "anchor"))

    @cached_property
    def has_anchor(self) -> bool:
        return "anchor" in self.sample._fields


class ImuKind(_Kind):
    record = struct.Struct("<I9f")

    def numbers(self, sample: ImuSample) -> tuple[float, ...]:
        """Return what stands behind the time in the packed record."""
        return *sample.acc, *sample.gyro, *(sample.mag or _NO_FIELD)

    def from_numbers(self, t_ns: int, *v: float) -> ImuSample:
        mag = None if math.isnan(v[6]) and math.isnan(v[7]) and math.isnan(v[8]) else (v[6], v[7], v[8])
        return ImuSample(t_ns, (v[0], v[1], v[2]), (v[3], v[4], v[5]), mag)


class ScalarKind(_Kind):
    """A kind that measures one number. Its samples are: t_ns, the anchor if there is one, the value, a second number.

    The second number may be unknown, NaN: the standard deviation of the value, or what its meaning depends on.
    description, meaning, second_meaning: of a sample and of its two numbers, in the JSON Schema.
    limits, second_limits: the least and the greatest value that a sensor can have measured, in the unit of the sample.
    below, above, second_outside: why a number outside the limits is rejected.
    """

    def __init__(
        self,
        name: str,
        field: str,
        sample: type[Any],
        *,
        description: str,
        meaning: str,
        limits: tuple[float, float],
        second_limits: tuple[float, float],
        below: Reason,
        above: Reason,
        second_meaning: str = "Standard deviation; omit it if unknown.",
        second_outside: Reason = Reason.STD_INVALID,
    ) -> None:
        super().__init__(name, field, sample)
        self.description, self.meaning = description, meaning
        self.limits, self.second_limits = limits, second_limits
        self.below, self.above = below, above
        self.second_meaning, self.second_outside = second_meaning, second_outside

    @cached_property
    def second(self) -> str:
        return str(self.sample._fields[-1])

    @cached_property
    def record(self) -> struct.Struct:
        return struct.Struct("<IIff" if self.has_anchor else "<Iff")

    def numbers(self, sample: tuple[float, ...]) -> tuple[float, ...]:
        """Return what stands behind the time in the packed record."""
        return sample[1:]

    def from_numbers(self, t_ns: int, *v: float) -> Any:
        return self.sample(t_ns, *v)


Kind = ImuKind | ScalarKind

_ANGLE = (-1_000.0, 1_000.0)  # rad: headings may be unwrapped, but not without end
_ANGLE_STD = (1e-4, math.tau)  # rad

IMU = ImuKind("imu", "imu", ImuSample)
SCALARS = (
    ScalarKind(
        "range",
        "ranges",
        RangeSample,
        description="One two-way range to an anchor.",
        meaning="Slant range, m.",
        limits=(0.0, 3_000.0),  # UWB radios end far below
        second_limits=(1e-3, 100.0),
        below=Reason.RANGE_NEGATIVE,
        above=Reason.RANGE_ABSURD,
    ),
    ScalarKind(
        "heading",
        "headings",
        HeadingSample,
        description="A heading from the tag's platform, for example a robot or a phone.",
        meaning="Counter-clockwise from east, rad.",
        limits=_ANGLE,
        second_limits=_ANGLE_STD,
        below=Reason.HEADING_ABSURD,
        above=Reason.HEADING_ABSURD,
    ),
    ScalarKind(
        "bearing",
        "bearings",
        BearingSample,
        description="The bearing of the tag, seen from the anchor.",
        meaning="Counter-clockwise from east, rad.",
        limits=_ANGLE,
        second_limits=_ANGLE_STD,
        below=Reason.BEARING_ABSURD,
        above=Reason.BEARING_ABSURD,
    ),
    ScalarKind(
        "pressure",
        "pressures",
        PressureSample,
        description="The pressure of the air at the tag, from a barometer.",
        meaning="Pressure as measured, not reduced to sea level, Pa.",
        limits=(30_000.0, 110_000.0),  # what barometers measure; hPa and kPa lie far below
        second_limits=(-60.0, 85.0),  # °C
        below=Reason.PRESSURE_NOT_PA,
        above=Reason.PRESSURE_ABSURD,
        second_meaning="Temperature of the air, °C; omit it if unknown.",
        second_outside=Reason.TEMPERATURE_ABSURD,
    ),
)
PRESSURE = SCALARS[-1]
KINDS: tuple[Kind, ...] = (IMU, *SCALARS)
"""In the order of a packed payload and of its counts; a new kind comes last."""
KIND_OF: dict[type[Any], Kind] = {kind.sample: kind for kind in KINDS}

_lists = attrgetter(*(kind.field for kind in KINDS))


class Frame:
    """The samples of one message. Times are UTC, or since the tag's boot if `boot_clock` is set.

    sequence: message counter of the publisher; None if it does not count.
    boot_id: random number, drawn at each start of the publisher. With None or 0 its messages are not numbered.
    replay: whether the samples come from a replayed recording; their times are those of the recording.
    anchor_names: number → name of the anchors that the message names by text.
    """

    def __init__(
        self,
        imu: list[ImuSample] | None = None,
        ranges: list[RangeSample] | None = None,
        headings: list[HeadingSample] | None = None,
        bearings: list[BearingSample] | None = None,
        pressures: list[PressureSample] | None = None,
        sequence: int | None = None,
        boot_id: int | None = None,
        boot_clock: bool = False,
        replay: bool = False,
        anchor_names: dict[int, str] | None = None,
    ) -> None:
        self.imu = [] if imu is None else imu
        self.ranges = [] if ranges is None else ranges
        self.headings = [] if headings is None else headings
        self.bearings = [] if bearings is None else bearings
        self.pressures = [] if pressures is None else pressures
        self.sequence, self.boot_id = sequence, boot_id
        self.boot_clock, self.replay = boot_clock, replay
        self.anchor_names = {} if anchor_names is None else anchor_names

    def __eq__(self, other: object) -> bool:
        return vars(self) == vars(other) if isinstance(other, Frame) else NotImplemented

    def __repr__(self) -> str:
        return f"Frame({', '.join(f'{name}={value!r}' for name, value in vars(self).items())})"

    def replaced(self, **changes: Any) -> "Frame":
        """Return a copy with other values of these attributes."""
        return Frame(**vars(self) | changes)

    def __len__(self) -> int:
        return sum(map(len, _lists(self)))

    def counts(self) -> list[int]:
        """Return the number of samples of each of `KINDS`."""
        return [len(samples) for samples in _lists(self)]

    def by_kind(self) -> Iterator[tuple[Kind, list[Any]]]:
        """Yield every one of `KINDS` with its samples."""
        return zip(KINDS, _lists(self), strict=True)

    def times(self) -> list[int]:
        return [sample.t_ns for samples in _lists(self) for sample in samples]

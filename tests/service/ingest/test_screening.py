"""Every bad value is counted under its reason, and the good samples beside it are kept."""

import math

import pytest

from dropanchor_schemas.wire import (
    ENCODING_PACKED,
    BearingSample,
    Frame,
    HeadingSample,
    ImuSample,
    PressureSample,
    RangeSample,
    Reason,
    encode_packed,
)
from dropanchor_service.ingest.decode import Decoded, decode
from dropanchor_service.ingest.screening import Rejected, screen

T = 1_760_000_000_000_000_000
NAN, INF = math.nan, math.inf
LEVEL, STILL = (0.0, 0.0, 9.81), (0.0, 0.0, 0.0)


def screened(*frames: Frame) -> tuple[Decoded, list[Rejected]]:
    return screen(decode([encode_packed(frame) for frame in frames], [ENCODING_PACKED] * len(frames)))


@pytest.mark.parametrize(
    ("range_m", "std_m", "reason"),
    [
        (NAN, NAN, Reason.NOT_FINITE),
        (INF, NAN, Reason.NOT_FINITE),
        (-INF, NAN, Reason.NOT_FINITE),
        (-0.01, NAN, Reason.RANGE_NEGATIVE),
        (3_001.0, NAN, Reason.RANGE_ABSURD),
        (1e38, NAN, Reason.RANGE_ABSURD),
        (5.0, 0.0, Reason.STD_INVALID),
        (5.0, -0.1, Reason.STD_INVALID),
        (5.0, INF, Reason.STD_INVALID),
    ],
)
def test_a_bad_range_is_counted_and_its_neighbours_are_kept(range_m: float, std_m: float, reason: Reason) -> None:
    good = RangeSample(T, 7, 5.0, 0.1)
    kept, rejected = screened(Frame(ranges=[good]), Frame(ranges=[good, RangeSample(T, 7, range_m, std_m), good]))
    assert [(r.reason, r.messages.tolist()) for r in rejected] == [(reason, [1])]
    assert kept.ranges["message"].tolist() == [0, 1, 1]
    assert kept.ranges["value"].tolist() == [5.0, 5.0, 5.0]


@pytest.mark.parametrize(
    ("sample", "reason"),
    [
        (ImuSample(T, (NAN, 0, 9.81), STILL), Reason.NOT_FINITE),
        (ImuSample(T, LEVEL, (0, INF, 0)), Reason.NOT_FINITE),
        (ImuSample(T, LEVEL, STILL, (1.0, NAN, 1.0)), Reason.NOT_FINITE),
        (ImuSample(T, (0, 0, 321.0), STILL), Reason.IMU_ABSURD),
        (ImuSample(T, LEVEL, (-73.0, 0, 0)), Reason.IMU_ABSURD),
        (ImuSample(T, LEVEL, STILL, (0, 5_001.0, 0)), Reason.IMU_ABSURD),
    ],
)
def test_a_bad_imu_sample_is_counted_and_its_neighbours_are_kept(sample: ImuSample, reason: Reason) -> None:
    good = ImuSample(T, LEVEL, STILL)
    kept, rejected = screened(Frame(imu=[good, sample, good]))
    assert [(r.reason, len(r.messages)) for r in rejected] == [(reason, 1)]
    assert len(kept.imu) == 2


@pytest.mark.parametrize(
    ("value", "std", "reason"),
    [
        (NAN, NAN, Reason.NOT_FINITE),
        (1_001.0, NAN, None),
        (1.0, 0.0, Reason.STD_INVALID),
        (1.0, 7.0, Reason.STD_INVALID),
    ],
)
def test_bad_angles_are_counted(value: float, std: float, reason: Reason | None) -> None:
    _, heading = screened(Frame(headings=[HeadingSample(T, value, std)]))
    _, bearing = screened(Frame(bearings=[BearingSample(T, 7, value, std)]))
    assert [r.reason for r in heading] == [reason or Reason.HEADING_ABSURD]
    assert [r.reason for r in bearing] == [reason or Reason.BEARING_ABSURD]


@pytest.mark.parametrize(
    ("pressure_pa", "temperature_c", "reason"),
    [
        (1_013.25, NAN, Reason.PRESSURE_NOT_PA),
        (101.325, NAN, Reason.PRESSURE_NOT_PA),
        (110_001.0, NAN, Reason.PRESSURE_ABSURD),
        (101_325.0, 294.65, Reason.TEMPERATURE_ABSURD),
        (NAN, 21.5, Reason.NOT_FINITE),
    ],
)
def test_a_pressure_in_another_unit_is_named(pressure_pa: float, temperature_c: float, reason: Reason) -> None:
    good = PressureSample(T, 101_325.0, 21.5)
    kept, rejected = screened(Frame(pressures=[good, PressureSample(T, pressure_pa, temperature_c), good]))
    assert [(r.reason, r.kind, len(r.messages)) for r in rejected] == [(reason, "pressure", 1)]
    assert kept.pressures["value"].tolist() == [101_325.0] * 2


def test_a_sample_with_several_errors_is_counted_once() -> None:
    _, rejected = screened(Frame(ranges=[RangeSample(T, 7, -1.0, -1.0)]))
    assert [(r.reason, len(r.messages)) for r in rejected] == [(Reason.RANGE_NEGATIVE, 1)]


def test_values_that_a_sensor_can_measure_pass_unchanged() -> None:
    frame = Frame(
        imu=[ImuSample(T, LEVEL, STILL), ImuSample(T, (-320.0, 0, 0), (72.0, 0, 0), (5_000.0, 0, 0))],
        ranges=[RangeSample(T, 7, 0.0), RangeSample(T, 7, 3_000.0, 0.001)],
        headings=[HeadingSample(T, -1_000.0, 2e-4)],
        bearings=[BearingSample(T, 7, 0.0)],
    )
    kept, rejected = screened(frame)
    assert not rejected
    assert [len(c) for c in (kept.imu, kept.ranges, kept.headings, kept.bearings)] == [2, 2, 1, 1]

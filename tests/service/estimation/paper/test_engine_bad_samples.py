"""The engine `paper` with samples that are late, absurd or not numbers, and after a fault."""

import math

import numpy as np
import pytest

from dropanchor_service.estimation.columns import (
    SampleBatch,
    State,
    StateReason,
)
from service.estimation.paper.one_row import engine, headings, imu, ranges, start, state_of
from service.estimation.rejected import rejected_rows


def test_an_absurd_sample_is_counted_and_costs_the_row_nothing() -> None:
    made = engine()
    made.process(headings((0, 0.0)))
    made.process(ranges((0, 10.0)))
    spinning = imu(0.1)
    spinning.imu["gyro"] = 1e300
    for sample, reason in ((spinning, "imu"), (ranges((0.1, -1e9)), "range"), (headings((0.1, 1e17)), "heading")):
        assert rejected_rows(made.process(sample)) == {f"{reason}_absurd": [0]}
    assert state_of(made.process(ranges((0.2, 10.0))).poses)[0] == State.TRACKING


@pytest.mark.parametrize("std", [1e300, math.inf, -1.0, 0.0])
def test_a_standard_deviation_that_cannot_be_is_replaced_by_the_default(std: float) -> None:
    made, expected = engine(), engine()
    sample = ranges((0, 10.2))
    sample.ranges["std"] = std
    made.process(headings((0, 0.0)))
    expected.process(headings((0, 0.0)))
    assert made.process(sample).poses["x"][0] == expected.process(ranges((0, 10.2))).poses["x"][0]


def test_samples_older_than_the_row_are_late_and_change_nothing() -> None:
    made = engine()
    made.process(headings((1.0, 0.0)))
    made.process(ranges((1.0, 10.0)))
    for old in (ranges((0.9, 10.0)), headings((0.9, 3.0)), imu(0.9)):
        out = made.process(old)
        assert rejected_rows(out) == {"late": [0]}
        assert len(out.poses) == 0


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (ranges((1.0, math.nan)), "not_finite"),
        (ranges((1.0, -math.inf)), "not_finite"),
        (headings((1.0, math.nan)), "not_finite"),
        (ranges((1.0, 10.0), anchor=7), "anchor_unknown"),
        (ranges((1.0, 10.0), anchor=-1), "anchor_unknown"),
    ],
)
def test_a_bad_sample_is_counted_and_not_used(bad: SampleBatch, reason: str) -> None:
    made = engine()
    made.process(headings((0, 0.0)))
    before = made.process(ranges((0, 10.0))).poses
    out = made.process(bad)
    assert rejected_rows(out) == {reason: [0]}
    assert len(out.poses) == 0
    after = made.process(ranges((0.1, 10.0))).poses  # not late: a refused sample does not move the row's time
    assert after["x"][0] == pytest.approx(before["x"][0], abs=0.05)


@pytest.mark.parametrize("field", ["acc", "gyro"])
def test_an_imu_sample_that_is_not_finite_is_counted_and_not_used(field: str) -> None:
    samples = imu(0.0)
    samples.imu[field][0, 1] = math.nan
    assert rejected_rows(engine().process(samples)) == {"not_finite": [0]}


@pytest.mark.parametrize("value", [1e300, -1e300, 1e160, 1e18])
@pytest.mark.parametrize("kind", ["range", "heading", "gyro", "acc", "mag", "std"])
def test_absurd_numbers_never_escape_as_a_pose_or_an_exception(kind: str, value: float) -> None:
    made = engine()
    made.configure(1, start())
    made.process(imu(0, 0.01, mag=(0, 20, -44)))
    made.process(ranges((0.02, 10.0)))
    made.process(headings((0, 0.0), row=1))
    absurd = {"range": ranges((0.03, value)), "heading": headings((0.03, value)), "std": ranges((0.03, 10.0))}
    sample = absurd.get(kind, imu(0.03))
    if kind == "std":
        sample.ranges["std"] = value
    if kind in ("gyro", "acc", "mag"):
        sample.imu[kind] = value
    made.process(sample)
    for i in range(20):
        made.process(imu(0.04 + i * 0.1, mag=(0, 20, -44)))
        poses = made.process(ranges((0.04 + i * 0.1, 10.0))).poses
        assert np.isfinite(poses["x"]).all() or state_of(poses)[0] in (State.INITIALISING, State.AMBIGUOUS)
        if np.isfinite(poses["x"]).all():
            assert abs(poses["x"][0]) < 100
    assert state_of(made.process(ranges((1.0, 10.0), row=1)).poses)[0] != State.INITIALISING


def test_a_row_whose_numbers_blow_up_starts_again_and_its_neighbour_is_unaffected() -> None:
    made, alone = engine(), engine()
    made.configure(1, start())
    for row in (0, 1):
        made.process(headings((0, 0.0), row=row))
        made.process(ranges((0, 10.0), row=row))
    alone.process(headings((0, 0.0)))
    alone.process(ranges((0, 10.0)))
    made._filters[1]._ekf.P[0, 0] = math.nan  # type: ignore[union-attr]
    poses = made.process(ranges((0.1, 10.0), row=1)).poses
    assert state_of(poses) == (State.INITIALISING, StateReason.FAULT)
    assert np.isnan(poses["x"]).all()
    made.process(headings((0.2, 0.0), row=1))
    # it is no longer where it started: a pose at the start would be wrong and look right
    poses = made.process(ranges((0.2, 10.0), row=1)).poses
    assert state_of(poses) == (State.AMBIGUOUS, StateReason.START_UNKNOWN)
    ours, theirs = made.process(ranges((0.3, 10.0))).poses, alone.process(ranges((0.3, 10.0))).poses
    assert ours.tobytes() == theirs.tobytes()

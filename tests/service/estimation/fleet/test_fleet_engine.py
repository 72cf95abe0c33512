"""The engine `fleet` from samples to poses."""

import numpy as np
import pytest

from dropanchor_service.estimation.columns import (
    ANCHOR,
    BEARING,
    SampleBatch,
    State,
)
from dropanchor_service.estimation.fleet.engine import FleetEngine
from service.estimation.rejected import rejected_rows
from support.fleet_runs import STEP, cut, engine, error_of, in_pieces, samples, settings
from support.fleet_tracks import CALIBRATED


def test_samples_become_a_pose_per_range_on_the_track() -> None:
    batch, truth = samples(2000)
    poses = engine().process(batch).poses
    assert len(poses) == len(batch.ranges)
    assert np.sqrt(np.mean(error_of(poses, truth) ** 2)) < 1.0
    assert poses["state"][-1] == State.TRACKING


def test_poses_do_not_depend_on_how_the_stream_was_cut() -> None:
    batch, _ = samples(2001)
    whole = in_pieces(engine(), batch, 10**12)
    for step_ns in (30_000_000, 170_000_000):
        assert in_pieces(engine(), batch, step_ns).tobytes() == whole.tobytes()


def test_ranges_ahead_of_their_imu_wait_for_it() -> None:
    batch, _ = samples(2002)
    expected = in_pieces(engine(), batch, 10**12)
    fleet = engine()
    ahead = []
    for t in range(0, int(batch.imu["t_ns"][-1]) + 200_000_000, 100_000_000):
        early = cut(batch, t, t + 100_000_000)
        late = cut(batch, t - 100_000_000, t)
        ahead.append(fleet.process(SampleBatch(imu=late.imu, ranges=early.ranges, headings=late.headings)).poses)
    poses = np.concatenate(ahead)
    assert poses["t_ns"].tolist() == expected["t_ns"].tolist()
    np.testing.assert_allclose(poses["x"][5:], expected["x"][5:], atol=0.3)


def test_a_range_that_comes_late_is_used_within_the_window_and_counted_beyond_it() -> None:
    batch, truth = samples(2003)
    fleet = engine()
    fleet.process(cut(batch, 0, 20_000_000_000))
    late = batch.ranges[[198]].copy()
    assert len(fleet.process(SampleBatch(ranges=late)).poses) == 1
    late["t_ns"] -= 2_000_000_000
    refused = fleet.process(SampleBatch(ranges=late))
    assert (len(refused.poses), rejected_rows(refused)) == (0, {"late": [0]})
    poses = fleet.process(cut(batch, 20_000_000_000, 10**12)).poses
    assert error_of(poses, truth)[-1] < 1.0


def test_nonsense_is_counted_by_reason_and_leaves_the_neighbour_alone() -> None:
    batch, _ = samples(2004, row=1)
    expected = engine(2).process(batch).poses
    bad = batch.ranges[:3].copy()
    bad["row"] = 0
    bad["range"][0], bad["anchor"][1], bad["anchor"][2] = np.nan, 7, -1
    mixed = SampleBatch(batch.imu, np.concatenate([bad, batch.ranges]), batch.headings)
    result = engine(2).process(mixed)
    assert rejected_rows(result) == {"not_finite": [0], "anchor_unknown": [0, 0]}
    assert result.poses.tobytes() == expected.tobytes()


def test_an_unknown_start_publishes_weighted_hypotheses_until_it_is_resolved() -> None:
    batch, truth = samples(2000)
    fleet = engine(known=False)
    first = fleet.process(cut(batch, 0, 2_500_000_000))
    assert first.poses["state"][-1] == State.AMBIGUOUS
    assert len(first.hypotheses) >= 2
    assert 0.5 < first.hypotheses["weight"].sum() <= 1.0 + 1e-9
    rest = fleet.process(cut(batch, 2_500_000_000, 10**12))
    assert rest.poses["state"][-1] == State.TRACKING
    assert len(rest.hypotheses) == 0
    assert error_of(rest.poses, truth)[-1] < 1.0


def test_a_bearing_settles_where_a_standing_tag_is() -> None:
    fleet = engine(known=False)
    batch, _ = samples(2005)
    still = cut(batch, 0, 100_000_000)
    n = 40
    imu, ranges, headings = (
        np.repeat(c[:1], k) for c, k in ((still.imu, n * STEP), (still.ranges, n), (still.headings, n))
    )
    imu["t_ns"] = np.arange(n * STEP) * 10_000_000
    imu["acc"] += 0.01 * np.random.default_rng(1).standard_normal((n * STEP, 3))  # or it would count as frozen
    ranges["t_ns"] = headings["t_ns"] = np.arange(n) * 100_000_000
    ranges["range"] = 10.0
    assert fleet.process(SampleBatch(imu, ranges, headings)).poses["state"][-1] == State.AMBIGUOUS
    bearing = np.zeros(20, BEARING)
    bearing["t_ns"] = int(imu["t_ns"][-1]) + np.arange(20) * 1_000_000
    bearing["bearing"], bearing["std"] = 0.8, 0.05
    fleet.process(SampleBatch(bearings=bearing))
    later = ranges[:5].copy()
    later["t_ns"] += int(bearing["t_ns"][-1]) + 1
    pose = fleet.process(SampleBatch(ranges=later)).poses[-1]
    assert np.arctan2(pose["y"], pose["x"]) == pytest.approx(0.8, abs=0.1)


def test_a_row_that_is_configured_again_starts_again() -> None:
    batch, _ = samples(2000)
    fleet = engine()
    expected = fleet.process(batch).poses
    fleet.configure(0, settings())
    assert fleet.process(batch).poses.tobytes() == expected.tobytes()


def test_every_range_that_met_a_belief_comes_with_its_innovation() -> None:
    fleet, (batch, _) = engine(), samples(5)
    batch.ranges["range"][40] += 5.0
    result = fleet.process(batch)
    innovations = result.innovations
    assert len(innovations) >= len(result.poses) - 1
    assert (innovations["t_ns"] == result.poses["t_ns"][-len(innovations) :]).all()
    assert (innovations["measured"] == result.poses["range"][-len(innovations) :]).all()
    np.testing.assert_allclose(innovations["measured"] - innovations["predicted"], innovations["innovation"])
    outlier = np.abs(innovations["measured"] - batch.ranges["range"][40]) < 1e-12
    assert innovations["p_outlier"][outlier] > 0.9
    assert not innovations["fused"][outlier]
    good = innovations[~outlier]
    assert good["fused"].mean() > 0.95
    assert np.mean(good["innovation"] ** 2 / good["S"]) == pytest.approx(1.0, abs=0.5)


def test_the_last_innovations_can_be_explained() -> None:
    batch, _ = samples(2000)
    result = engine().process(batch)
    innovations = result.innovations
    assert innovations["t_ns"].tolist() == result.poses["t_ns"][-len(innovations) :].tolist()
    assert (innovations["S"] > 0).all()
    assert np.abs(innovations["innovation"] / np.sqrt(innovations["S"])).mean() < 2.0
    assert ((innovations["p_outlier"] >= 0) & (innovations["p_outlier"] <= 1)).all()


def test_samples_of_one_batch_may_come_in_any_order() -> None:
    batch, _ = samples(2006)
    rng = np.random.default_rng(1)
    shuffled = SampleBatch(*(c[rng.permutation(len(c))] for c in (batch.imu, batch.ranges, batch.headings)))
    assert engine().process(shuffled).poses.tobytes() == engine().process(batch).poses.tobytes()


def test_many_unknown_starts_at_once_have_room_for_their_hypotheses() -> None:
    alone, _ = samples(2007)
    alone = cut(alone, 0, 3_000_000_000)
    rows = 40
    many = SampleBatch(*(np.tile(c, rows) for c in (alone.imu, alone.ranges, alone.headings)))
    for column in (many.imu, many.ranges, many.headings):
        column["row"] = np.repeat(np.arange(rows), len(column) // rows)
    expected, found = engine(known=False).process(alone), engine(rows, known=False).process(many)
    for row in (0, 17, rows - 1):
        own = found.poses[found.poses["row"] == row].copy()
        own["row"] = 0
        assert own.tobytes() == expected.poses.tobytes()
        assert (found.hypotheses["row"] == row).sum() == len(expected.hypotheses) > 1


def test_samples_of_a_row_that_is_not_configured_are_an_error() -> None:
    batch, _ = samples(2008, row=1)
    with pytest.raises(IndexError, match="not configured"):
        engine(1).process(batch)


def test_pending_samples_are_part_of_the_state() -> None:
    batch, _ = samples(2009)
    fleet, restored = engine(3), FleetEngine(CALIBRATED)
    ahead = SampleBatch(batch.imu[:1000], batch.ranges[:110], batch.headings[:110])
    fleet.process(ahead)
    assert len(fleet.state()["pending"]) > 0
    restored.set_anchors(np.zeros(1, ANCHOR))
    restored.restore({name: array.copy() for name, array in fleet.state().items()})
    rest = SampleBatch(batch.imu[1000:], batch.ranges[110:], batch.headings[110:])
    assert restored.process(rest).poses.tobytes() == fleet.process(rest).poses.tobytes()

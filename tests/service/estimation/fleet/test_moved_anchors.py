"""Tracks go on when somebody corrects the place of an anchor: they shift with it, or other anchors hold them."""

from collections.abc import Sequence

import numpy as np
import pytest

from dropanchor_service.estimation.columns import Array, SampleBatch, State, anchors_at
from dropanchor_service.estimation.fleet.engine import FleetEngine
from support.fleet_runs import cut, engine, error_of, samples, settings
from support.fleet_tracks import CALIBRATED

Place = tuple[float, float, float]
AT_NS = 20_000_000_000
ORIGIN: Place = (0.0, 0.0, 0.0)
FAR: Place = (10.0, 40.0, 0.0)


def places(*anchors: Place) -> Array:
    return anchors_at(*anchors)


def halves(batch: SampleBatch) -> tuple[SampleBatch, SampleBatch]:
    end_ns = int(batch.imu["t_ns"][-1]) + 1
    return cut(batch, 0, AT_NS), cut(batch, AT_NS, end_ns)


def after_moves(fleet: FleetEngine, batch: SampleBatch, *moves: Sequence[Place]) -> Array:
    """Return the poses of the second half of a drive, before which anchors go to one set of places after another."""
    first, second = halves(batch)
    fleet.process(first)
    for anchors in moves:
        assert not len(fleet.move_anchors(places(*anchors)))
    return fleet.process(second).poses


def hears_both(seed: int) -> tuple[SampleBatch, Array]:
    """Return a drive that also hears an anchor at FAR, and its truth."""
    batch, truth = samples(seed)
    other = batch.ranges.copy()
    index = np.arange(len(other))
    noise = 0.1 * np.random.default_rng(seed).standard_normal(len(other))
    other["t_ns"] += 50_000_000
    other["anchor"] = 1
    other["range"] = np.hypot(truth.x[index] - FAR[0], truth.y[index] - FAR[1]) + noise
    ranges = np.concatenate([batch.ranges, other])
    ranges = ranges[np.argsort(ranges["t_ns"], kind="stable")]
    return SampleBatch(imu=batch.imu, ranges=ranges, headings=batch.headings), truth


def deviations(poses: Array, truth: Array) -> Array:
    """Return the errors of poses that are tracked, in standard deviations."""
    tracked = poses[poses["state"] == State.TRACKING]
    found: Array = error_of(tracked, truth) / np.sqrt(tracked["cov"][:, 0, 0] + tracked["cov"][:, 1, 1])
    return found


@pytest.mark.parametrize("undone", [False, True])
def test_with_one_anchor_every_pose_shifts_with_it_and_back(undone: bool) -> None:
    batch, _ = samples(3)
    shifted: Place = (3.0, -2.0, 0.0)
    moves = [[shifted], [ORIGIN]] if undone else [[shifted]]
    by = ORIGIN if undone else shifted
    as_before = after_moves(engine(known=False), batch)
    poses = after_moves(engine(known=False), batch, *moves)
    assert (poses["state"] == as_before["state"]).all()
    assert np.isfinite(poses["x"]).all()
    np.testing.assert_allclose(poses["x"] - by[0], as_before["x"], atol=1e-9)
    np.testing.assert_allclose(poses["y"] - by[1], as_before["y"], atol=1e-9)
    np.testing.assert_allclose(poses["cov"], as_before["cov"], rtol=1e-9)


def test_anchors_that_all_move_alike_take_the_tracks_with_them() -> None:
    batch, _ = hears_both(3)
    fleets = [FleetEngine(CALIBRATED) for _ in range(2)]
    for fleet in fleets:
        fleet.set_anchors(places(ORIGIN, FAR))
        fleet.configure(0, settings(known=False))
    by = 4.0
    moved = after_moves(fleets[0], batch, [(by, 0.0, 0.0), (FAR[0] + by, *FAR[1:])])
    np.testing.assert_allclose(moved["x"] - by, after_moves(fleets[1], batch)["x"], atol=1e-9)


def test_a_corrected_height_keeps_the_slant_distance() -> None:
    batch, _ = samples(3)
    fleet = engine(known=False)
    poses = after_moves(fleet, batch, [(0.0, 0.0, 4.0)])
    level = np.hypot(poses["x"][0], poses["y"][0])
    assert np.hypot(level, 4.0) == pytest.approx(poses["range"][0], abs=0.5)
    assert (poses["state"] == State.TRACKING).all()


@pytest.mark.parametrize("corrected", ["first", "second"])
def test_with_several_anchors_tags_keep_their_places_and_are_exact_within_seconds(corrected: str) -> None:
    """An anchor that was three metres off made all poses wrong; those after its correction are right."""
    batch, truth = hears_both(3)
    wrong = [(3.0, 0.0, 0.0), FAR] if corrected == "first" else [ORIGIN, (FAR[0], FAR[1] + 3.0, 0.0)]
    fleet = FleetEngine(CALIBRATED)
    fleet.set_anchors(places(*wrong))
    fleet.configure(0, settings())
    poses = after_moves(fleet, batch, [ORIGIN, FAR])
    assert np.isfinite(poses["x"]).all()
    assert deviations(poses, truth).max(initial=0.0) < 5.0
    later = poses[poses["t_ns"] > AT_NS + 5_000_000_000]
    assert (later["state"] == State.TRACKING).mean() > 0.9
    assert np.median(error_of(later, truth)) < 0.3


def test_a_tag_that_stands_at_its_told_start_stays_there() -> None:
    fleet = engine()
    batch, _ = samples(3)
    still = cut(batch, 0, 3_000_000_000)
    rng, size = np.random.default_rng(3), still.imu["acc"].shape
    still.ranges["range"] = 10.0 + 0.1 * rng.standard_normal(len(still.ranges))
    still.imu["gyro"] = 0.002 * rng.standard_normal(size)
    still.imu["acc"] = (0.0, 0.0, 9.80665) + 0.01 * rng.standard_normal(size)
    still.headings["heading"] = still.headings["heading"][0]
    fleet.process(cut(still, 0, 2_000_000_000))
    assert not len(fleet.move_anchors(places((0.0, 3.0, 0.0))))
    poses = fleet.process(cut(still, 2_000_000_000, 3_000_000_000)).poses
    assert poses["y"] == pytest.approx(0.0, abs=0.3)
    assert (poses["state"] == State.TRACKING).all()


def test_a_track_of_a_told_start_keeps_its_place_and_becomes_as_unsure_as_the_correction() -> None:
    batch, truth = samples(3)
    fleet = engine()
    poses = after_moves(fleet, batch, [(3.0, 0.0, 0.0)], [ORIGIN])
    assert np.isfinite(poses["x"]).all()
    assert poses["sigma_pos"][0] > 2.0
    assert deviations(poses, truth).max(initial=0.0) < 5.0
    assert not fleet.are_at_start(np.array([0]))[0]


def test_a_tag_that_hears_another_anchor_than_the_corrected_one_goes_on() -> None:
    batch, _ = samples(3)
    fleets = [FleetEngine(CALIBRATED) for _ in range(2)]
    for fleet in fleets:
        fleet.set_anchors(places(ORIGIN, FAR))
        fleet.configure(0, settings())
    moved = after_moves(fleets[0], batch, [ORIGIN, (99.0, 0.0, 0.0)])
    assert (moved == after_moves(fleets[1], batch)).all()


def test_a_tag_that_does_not_know_where_it_is_starts_afresh_beside_several_anchors() -> None:
    batch, _ = hears_both(3)
    fleet = FleetEngine(CALIBRATED)
    fleet.set_anchors(places(ORIGIN, FAR))
    fleet.configure(0, settings(known=False))
    fleet.process(cut(batch, 0, 1_500_000_000))
    assert fleet.move_anchors(places(ORIGIN, (FAR[0] + 3.0, *FAR[1:]))).tolist() == [0]

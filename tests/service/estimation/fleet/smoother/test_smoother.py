"""The smoother on whole drives."""

from typing import Any

import numpy as np
import pytest

from dropanchor_evaluation.product.rows import selected, simulated_rows
from dropanchor_evaluation.product.smoothing import Task, work
from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import ANCHOR, State
from dropanchor_service.estimation.fleet.smoother.smoothed import CONTRADICTED, smoothed_poses
from dropanchor_service.estimation.fleet.smoother.trace import TracingEngine
from support.fleet_runs import cut, engine, error_of, in_pieces, samples, settings, traced
from support.fleet_tracks import CALIBRATED

SEEDS = range(2000, 2008)


def inside(poses: Any, truth: Any) -> Any:
    """Return whether the truth lies in the 95 % ellipse."""
    index = np.round(poses["t_ns"] / 1e8).astype(int)
    e = np.stack([poses["x"] - truth.x[index], poses["y"] - truth.y[index]], axis=1)
    return np.einsum("ni,nij,nj->n", e, np.linalg.inv(poses["cov"][:, :2, :2]), e) < CHI2_95_OF_2


def rms(error: Any) -> float:
    return float(np.sqrt(np.nanmean(error**2)))


def test_more_later_samples_give_a_better_track_and_the_ellipses_hold() -> None:
    errors, cover = [], []
    for seed in SEEDS:
        fleet, poses, truth = traced(seed)
        tracks = [poses, smoothed_poses(fleet, 0, 2.0).poses, smoothed_poses(fleet, 0, None).poses]
        known = np.isfinite(poses["x"])
        errors.append([rms(error_of(track, truth)) for track in tracks])
        cover.append([inside(track[known], truth).mean() for track in tracks])
    filtered, lagged, offline = np.median(errors, axis=0)
    assert lagged < 0.9 * filtered
    assert offline < lagged
    assert np.median(cover, axis=0)[1:].min() > 0.93
    assert np.mean(cover, axis=0)[2] > 0.93
    assert np.mean(cover, axis=0)[1] >= np.mean(cover, axis=0)[0]  # a wrong mode of the filter is one of the lag too


def test_with_all_samples_an_ambiguous_start_has_the_place_that_is_left_and_says_that_it_was_ambiguous() -> None:
    ratios = []
    for seed in SEEDS[:4]:
        fleet, poses, truth = traced(seed, known=False)
        ambiguous = poses["state"] == State.AMBIGUOUS
        offline, used = smoothed_poses(fleet, 0, None)
        assert used[ambiguous].mean() > 0.9
        assert (offline["state"] == poses["state"]).all()
        ratios.append(rms(error_of(offline, truth)[ambiguous]) / rms(error_of(poses, truth)[ambiguous]))
    assert np.median(ratios) < 0.5
    assert np.mean(np.array(ratios) < 1.0) > 0.7  # one in ten begins in the mirror image, as the filter may


def test_a_fixed_lag_track_does_not_depend_on_later_samples() -> None:
    batch, _ = samples(2001)
    part = cut(batch, 0, 15_000_000_000)
    tracks = []
    for each in (batch, part):
        fleet = TracingEngine(CALIBRATED)
        fleet.set_anchors(np.zeros(1, ANCHOR))
        fleet.configure(0, settings())
        fleet.process(each)
        tracks.append(smoothed_poses(fleet, 0, 2.0).poses)
    early = tracks[0]["t_ns"] < 12_500_000_000
    assert tracks[0][early].tobytes() == tracks[1][: early.sum()].tobytes()


def test_an_engine_that_is_traced_gives_the_same_poses_and_smoothing_is_deterministic() -> None:
    batch, _ = samples(2002)
    fleet, poses, _ = traced(2002)
    assert in_pieces(engine(), batch, 1_000_000_000).tobytes() == poses.tobytes()
    for lag in (None, 2.0):
        once, again = smoothed_poses(fleet, 0, lag), smoothed_poses(fleet, 0, lag)
        assert once.poses.tobytes() == again.poses.tobytes()
        assert (once.poses["t_ns"] == poses["t_ns"]).all()


def test_single_ranges_that_are_far_too_long_do_no_harm() -> None:
    batch, truth = samples(2003)
    batch.ranges["range"][40:250:10] += 1.5
    fleet = TracingEngine(CALIBRATED)
    fleet.set_anchors(np.zeros(1, ANCHOR))
    fleet.configure(0, settings())
    poses = fleet.process(batch).poses
    assert rms(error_of(smoothed_poses(fleet, 0, None).poses, truth)) < rms(error_of(poses, truth))
    clean, _, _ = traced(2003)
    spoilt = rms(error_of(smoothed_poses(fleet, 0, None).poses, truth))
    assert spoilt < 1.5 * rms(error_of(smoothed_poses(clean, 0, None).poses, truth)) + 0.05


def test_a_row_without_samples_has_no_smoothed_pose() -> None:
    fleet = TracingEngine(CALIBRATED)
    fleet.configure(0, settings())
    assert len(smoothed_poses(fleet, 0, None).poses) == 0


@pytest.mark.parametrize("lag", [None, 2.0])
def test_a_smoothed_pose_agrees_with_the_filter_and_keeps_its_ellipse_or_it_is_the_filtered_one(
    lag: float | None,
) -> None:
    fleet, poses, _ = traced(2004, known=False)
    smooth, used = smoothed_poses(fleet, 0, lag)
    assert used.mean() > 0.5
    assert smooth[~used].tobytes() == poses[~used].tobytes()
    before, after = poses[used], smooth[used]
    d = np.stack([after["x"] - before["x"], after["y"] - before["y"]], axis=1)
    assert (np.einsum("ni,nij,nj->n", d, np.linalg.inv(before["cov"][:, :2, :2]), d) < CONTRADICTED).all()
    for name in set(poses.dtype.names) - {"x", "y", "heading", "speed"}:
        assert after[name].tobytes() == before[name].tobytes()
    assert np.hypot(*d[-1]) < 0.01  # no later samples say more about the last one


def test_a_belief_that_is_not_trusted_says_nothing_about_what_was_before() -> None:
    batch, _ = samples(2004)
    fleet = TracingEngine(CALIBRATED)
    fleet.set_anchors(np.zeros(1, ANCHOR))
    fleet.configure(0, settings(known=False))
    poses = fleet.process(cut(batch, 0, 4_000_000_000)).poses
    assert (poses["state"] == State.AMBIGUOUS).any()
    assert (poses["state"] != State.TRACKING).all()
    smooth, used = smoothed_poses(fleet, 0, None)
    assert not used.any()
    assert smooth.tobytes() == poses.tobytes()


@pytest.mark.parametrize(
    ("name", "seed", "share"),
    [
        ("M5/scalar/nothing/known", 5001, 0.8),
        ("S5/scalar/nothing/unknown", 5002, 0.5),
        ("S5+lasting0.5/9-axis/nothing/known", 5004, 0.9),  # what nobody told: errors of ranges last
        ("walk-turned/scalar/nothing/known", 5002, 1.0),
    ],
)
def test_a_smoothed_track_is_never_worse_than_the_filtered_one(name: str, seed: int, share: float) -> None:
    (row,) = selected(simulated_rows(), [name])
    filtered, whole, lagged = work(Task(row, range(seed, seed + 1))).scores
    assert whole.rmse[0] < share * filtered.rmse[0]
    assert lagged.rmse[0] < 1.02 * filtered.rmse[0]
    assert min(whole.coverage, lagged.coverage) >= filtered.coverage
    assert whole.tracking_share == lagged.tracking_share == filtered.tracking_share


@pytest.mark.parametrize("lag", [None, 3.0])
def test_where_errors_last_that_nobody_told_of_the_ellipses_hold_as_often_as_the_filters(lag: float | None) -> None:
    errors, held = [], []
    for seed in SEEDS[:4]:
        batch, truth = samples(seed)
        t = batch.ranges["t_ns"] / 1e9
        batch.ranges["range"] += 0.3 * np.sin(0.6 * t + seed)
        fleet = TracingEngine(CALIBRATED)
        fleet.set_anchors(np.zeros(1, ANCHOR))
        fleet.configure(0, settings())
        poses = fleet.process(batch).poses
        tracks = poses, smoothed_poses(fleet, 0, lag).poses
        errors.append([rms(error_of(track, truth)) for track in tracks])
        held.append([inside(track, truth).mean() for track in tracks])
    assert np.subtract(*np.mean(held, axis=0)) <= 0.0
    assert np.subtract(*np.mean(errors, axis=0)) > 0.0  # one of the four is worse: what lasts is not told apart

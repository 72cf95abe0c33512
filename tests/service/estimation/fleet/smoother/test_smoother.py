"""The smoother on whole drives."""

from typing import Any

import numpy as np

from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import ANCHOR, State
from dropanchor_service.estimation.fleet.smoother.smoothed import smoothed_poses
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
        tracks = [poses, smoothed_poses(fleet, 0, 2.0), smoothed_poses(fleet, 0, None)]
        known = np.isfinite(poses["x"])
        errors.append([rms(error_of(track, truth)) for track in tracks])
        cover.append([inside(track[known], truth).mean() for track in tracks])
    filtered, lagged, offline = np.median(errors, axis=0)
    assert lagged < 0.9 * filtered
    assert offline < lagged
    assert np.median(cover, axis=0)[1:].min() > 0.93
    assert np.mean(cover, axis=0)[2] > 0.93
    assert np.mean(cover, axis=0)[1] >= np.mean(cover, axis=0)[0]  # a wrong mode of the filter is one of the lag too


def test_with_all_samples_an_ambiguous_start_is_resolved_from_the_first_pose_on() -> None:
    ratios = []
    for seed in SEEDS[:4]:
        fleet, poses, truth = traced(seed, known=False)
        ambiguous = poses["state"] == State.AMBIGUOUS
        offline = smoothed_poses(fleet, 0, None)
        assert ambiguous.any()
        assert (offline["state"][ambiguous] == State.TRACKING).all()
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
        tracks.append(smoothed_poses(fleet, 0, 2.0))
    early = tracks[0]["t_ns"] < 12_500_000_000
    assert tracks[0][early].tobytes() == tracks[1][: early.sum()].tobytes()


def test_an_engine_that_is_traced_gives_the_same_poses_and_smoothing_is_deterministic() -> None:
    batch, _ = samples(2002)
    fleet, poses, _ = traced(2002)
    assert in_pieces(engine(), batch, 1_000_000_000).tobytes() == poses.tobytes()
    for lag in (None, 2.0):
        once = smoothed_poses(fleet, 0, lag)
        assert once.tobytes() == smoothed_poses(fleet, 0, lag).tobytes()
        assert (once["t_ns"] == poses["t_ns"]).all()


def test_single_ranges_that_are_far_too_long_do_no_harm() -> None:
    batch, truth = samples(2003)
    batch.ranges["range"][40:250:10] += 1.5
    fleet = TracingEngine(CALIBRATED)
    fleet.set_anchors(np.zeros(1, ANCHOR))
    fleet.configure(0, settings())
    poses = fleet.process(batch).poses
    assert rms(error_of(smoothed_poses(fleet, 0, None), truth)) < rms(error_of(poses, truth))
    clean, _, _ = traced(2003)
    spoilt = rms(error_of(smoothed_poses(fleet, 0, None), truth))
    assert spoilt < 1.5 * rms(error_of(smoothed_poses(clean, 0, None), truth)) + 0.05


def test_a_row_without_samples_has_no_smoothed_pose() -> None:
    fleet = TracingEngine(CALIBRATED)
    fleet.configure(0, settings())
    assert len(smoothed_poses(fleet, 0, None)) == 0

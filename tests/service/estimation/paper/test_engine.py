"""The engine `paper` on tags with a known truth."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from dropanchor_service.estimation.columns import ANCHOR, Array, SampleBatch, default_settings
from dropanchor_service.estimation.paper.engine import PaperEngine
from dropanchor_service.estimation.paper.parameters import TUNED
from service.estimation.paper.legs import (
    T0_NS,
    Track,
    imu_samples,
    range_samples,
    samples_of,
    settings_at_start,
    straight_legs,
)


def engine_for(settings: Array) -> PaperEngine:
    engine = PaperEngine(TUNED)
    engine.set_anchors(np.zeros(1, ANCHOR))
    engine.configure(0, settings)
    return engine


def between(samples: SampleBatch, first: int, last: int) -> SampleBatch:
    """Return the samples after `first` and up to `last`, ns."""
    cut = [columns[(columns["t_ns"] > first) & (columns["t_ns"] <= last)] for columns in (samples.imu, samples.ranges)]
    return SampleBatch(imu=cut[0], ranges=cut[1])


def rmse(poses: Array, track: Track) -> float:
    x, y = track.at((poses["t_ns"] - T0_NS) * 1e-9)
    return math.sqrt(np.mean((poses["x"] - x) ** 2 + (poses["y"] - y) ** 2))


@pytest.mark.parametrize("imu", [True, False], ids=["imu", "platform heading"])
def test_most_runs_on_straight_legs_from_a_known_start_are_tracked(imu: bool) -> None:
    """One in five ends in the mirror image, as a filter with one mode cannot avoid."""
    errors = []
    for seed in range(8):
        track = straight_legs(seed)
        poses = engine_for(settings_at_start(track)).process(samples_of(track, seed, imu)).poses
        assert len(poses) == len(track.t[::10])
        errors.append(rmse(poses, track))
    assert sorted(errors)[4] < 2.0


def test_however_the_samples_are_cut_into_batches_the_poses_are_the_same_to_the_last_bit() -> None:
    track = straight_legs(seed=3, legs=2)
    samples = samples_of(track, seed=3)
    whole = engine_for(settings_at_start(track)).process(samples).poses
    engine, parts, rng = engine_for(settings_at_start(track)), [], np.random.default_rng(9)
    cuts = np.sort(rng.uniform(0, track.t[-1], 60))
    bounds = T0_NS + np.concatenate([[-1], cuts * 1e9, [1e12]]).astype(np.int64)
    for first, last in pairwise(bounds):
        parts.append(engine.process(between(samples, first, last)).poses)
    assert np.concatenate(parts).tobytes() == whole.tobytes()


def test_rows_in_one_batch_do_not_disturb_each_other() -> None:
    tracks = [straight_legs(seed, legs=1) for seed in (4, 5)]
    both = PaperEngine(TUNED)
    both.set_anchors(np.zeros(1, ANCHOR))
    imu, ranges, alone = [], [], []
    for row, track in enumerate(tracks):
        samples = samples_of(track, seed=row)
        alone.append(engine_for(settings_at_start(track)).process(samples).poses)
        both.configure(row, settings_at_start(track))
        imu.append(samples.imu)
        ranges.append(samples.ranges)
        imu[-1]["row"] = ranges[-1]["row"] = row
    poses = both.process(SampleBatch(imu=np.concatenate(imu), ranges=np.concatenate(ranges))).poses
    for row in (0, 1):
        assert poses["x"][poses["row"] == row].tolist() == alone[row]["x"].tolist()


def test_samples_that_arrive_out_of_order_within_a_batch_are_put_in_order() -> None:
    track = straight_legs(seed=6, legs=1)
    samples = samples_of(track, seed=6)
    backwards = SampleBatch(imu=samples.imu[::-1], ranges=samples.ranges[::-1])
    out = engine_for(settings_at_start(track)).process(backwards)
    assert not out.rejected
    assert out.poses.tobytes() == engine_for(settings_at_start(track)).process(samples).poses.tobytes()


def test_a_turn_ends_the_line_from_which_speed_is_taken() -> None:
    """Drive east past the anchor, turn by 90° and drive on. Pairs across the turn would give a wrong speed."""
    t = np.arange(0, 20, 0.01)
    turn = np.where((t > 10) & (t <= 10.5), math.pi, 0.0)
    heading, speed = np.cumsum(turn) * 0.01, np.full(len(t), 2.0)
    x, y = -10 + np.cumsum(2 * np.cos(heading)) * 0.01, -5 + np.cumsum(2 * np.sin(heading)) * 0.01
    track, rng = Track(t, x, y, heading, speed, turn), np.random.default_rng(2)
    samples = SampleBatch(imu=imu_samples(track, rng), ranges=range_samples(track, rng, std=1e-4))
    engine = PaperEngine(replace(TUNED, q_smooth=100.0, r_smooth=1e-4, window_base=1, window_ratio=0, th_distance=0.5))
    engine.set_anchors(np.zeros(1, ANCHOR))
    engine.configure(0, default_settings())  # without a start the published speed is that of the ranges alone
    speeds = engine.process(samples).poses["speed"]
    assert np.nanmax(np.abs(speeds - 2.0)) < 0.1


def test_the_speed_estimator_pulls_the_speed_of_the_filter_towards_the_truth() -> None:
    """Compare the mean of Algorithm 1 with the plain EKF (w = 1: no blending), from an uncertain speed."""
    errors = {}
    for blend in (TUNED.blend, 1.0):
        engine, wrong = PaperEngine(replace(TUNED, blend=blend)), []
        engine.set_anchors(np.zeros(1, ANCHOR))
        for seed in range(4):
            track = straight_legs(seed, legs=1)
            engine.configure(0, settings_at_start(track))
            poses = engine.process(samples_of(track, seed)).poses
            wrong.append(np.abs(poses["speed"] - track.speed[::10]).mean())
        errors[blend] = np.mean(wrong)
    assert errors[TUNED.blend] < errors[1.0]


def test_an_empty_batch_gives_no_poses() -> None:
    out = engine_for(settings_at_start(straight_legs(1))).process(SampleBatch())
    assert len(out.poses) == 0
    assert not out.rejected

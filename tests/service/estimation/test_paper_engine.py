"""The engine `paper` on tags whose truth is known."""

import math

import numpy as np
import pytest

from dropanchor_service.estimation.batch import ANCHOR, Array, SampleBatch
from dropanchor_service.estimation.paper import TUNED, PaperEngine
from service.estimation.legs import T0_NS, Track, samples_of, settings_at_start, straight_legs


def engine_for(settings: Array) -> PaperEngine:
    engine = PaperEngine(TUNED)
    engine.set_anchors(np.zeros(1, ANCHOR))
    engine.configure(0, settings)
    return engine


def rmse(poses: Array, track: Track) -> float:
    x, y = track.at((poses["t_ns"] - T0_NS) * 1e-9)
    return math.sqrt(np.mean((poses["x"] - x) ** 2 + (poses["y"] - y) ** 2))


@pytest.mark.parametrize("imu", [True, False], ids=["imu", "platform heading"])
def test_most_runs_on_straight_legs_from_a_known_start_are_tracked(imu: bool) -> None:
    """Most: one in five ends in the mirror image, which is in the nature of a filter with one mode."""
    errors = []
    for seed in range(8):
        track = straight_legs(seed)
        poses = engine_for(settings_at_start(track)).process(samples_of(track, seed, imu)).poses
        assert len(poses) == len(track.t[::10])
        errors.append(rmse(poses, track))
    assert sorted(errors)[4] < 2.0


def test_an_empty_batch_gives_no_poses() -> None:
    out = engine_for(settings_at_start(straight_legs(1))).process(SampleBatch())
    assert len(out.poses) == 0
    assert out.rejected == {}

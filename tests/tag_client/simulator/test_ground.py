"""The motions of the trolley and the forklift."""

import numpy as np

from dropanchor_tag_client.simulator.ground import smooth
from dropanchor_tag_client.simulator.scenarios import trajectory
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import simulate


def test_the_same_seed_gives_the_same_motion() -> None:
    for scenario in ("rolling", "forklift"):
        np.testing.assert_array_equal(trajectory(scenario, 5000).x, trajectory(scenario, 5000).x)
        assert trajectory(scenario, 5000).x[-1] != trajectory(scenario, 5001).x[-1]


def test_a_rolling_trolley_has_the_noise_of_one_at_rest() -> None:
    run = simulate("rolling", 5000, smooth(preset("real", imu_hz=100.0)))
    steady = (run.truth.v > 0.2) & (np.abs(np.gradient(run.truth.v, 0.01)) < 1e-6) & (np.abs(run.truth.w) < 1e-6)
    rest = run.truth.v == 0.0
    assert steady.sum() > 500
    for samples, expected in ((run.imu.acc, 0.05), (run.imu.gyro, 0.003)):
        noise = [np.diff(samples[part], axis=0).std() / np.sqrt(2) for part in (steady, rest)]
        np.testing.assert_allclose(noise, expected, rtol=0.15)


def test_rolling_ramps_take_two_seconds() -> None:
    motion = trajectory("rolling", 5002)
    assert np.abs(np.diff(motion.v) / motion.dt).max() < 1.5 * np.pi / 4


def test_a_forklift_reverses_between_stops_without_turning_round() -> None:
    motion = trajectory("forklift", 5000)
    backwards = motion.v < 0
    assert 0.08 < backwards.mean() < 0.5
    assert motion.v.min() > -1.3
    moved = np.column_stack([np.diff(motion.x), np.diff(motion.y)])
    ahead = np.column_stack([np.cos(motion.course), np.sin(motion.course)])[1:]
    assert np.all((moved * ahead).sum(axis=1)[backwards[1:] & backwards[:-1]] < 0)
    changes = np.flatnonzero(np.diff(np.sign(motion.v)))
    assert not np.any(motion.v[changes] * motion.v[changes + 1] < 0)  # it stops before it turns round

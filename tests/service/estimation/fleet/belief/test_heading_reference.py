"""The error that the hypotheses share with a magnetometer, while it learns and while it is disturbed."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dropanchor_evaluation.simulated import PriorKnowledge, run_engine
from dropanchor_service.estimation.fleet.belief.heading_reference import follow_reference
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_tag_client.simulator.simulation import simulate


@pytest.mark.parametrize(("before", "after"), [(0.09, 0.09), (0.09, 0.0899), (0.09, 0.001), (0.001, 0.09)])
def test_the_shared_error_has_the_variance_of_the_reference(before: float, after: float) -> None:
    decay, growth = follow_reference(math.exp(-0.1 / 30.0), before, after)
    assert growth >= 0.0
    expected = after if after <= before else after * (1.0 - math.exp(-0.2 / 30.0)) + after - before * (1.0 - decay**2)
    assert decay**2 * before + growth == pytest.approx(expected)


def test_what_a_reference_learns_is_learned_of_the_same_error() -> None:
    """An error seen 400 times, as a filter of it says: cov(error after, error before) is the variance after."""
    rng = np.random.default_rng(1)
    truth = rng.normal(0, 0.3, 20_000)
    estimates, variance = np.zeros_like(truth), 0.09
    for _ in range(3):
        before, gain = truth - estimates, variance / (variance + 0.04)
        estimates += gain * (truth + rng.normal(0, 0.2, len(truth)) - estimates)
        after, variance = truth - estimates, variance * (1.0 - gain)
        decay, growth = follow_reference(1.0, float(before.var()), variance)
        assert (after * before).mean() / (before**2).mean() == pytest.approx(decay, rel=0.05)
        assert (after - decay * before).var() == pytest.approx(growth, rel=0.1)


def test_after_a_gap_the_magnetometer_decides_among_the_headings() -> None:
    """The heaviest of them is not taken for true: M5's seed 5014 once was 27 standard deviations off after its gap."""
    run = simulate("M5", 5014)
    heard = (run.imu.t_s < 20.0) | (run.imu.t_s >= 28.0)
    silent = run.imu._replace(**{name: values[heard] for name, values in run.imu._asdict().items()})
    poses = run_engine(FleetEngine(), [replace(run, imu=silent)], PriorKnowledge("raw", start=True)).tracks[0].poses
    late = poses[poses["t_ns"] > 40e9]
    true = np.interp(late["t_ns"] * 1e-9, run.truth.t_s, np.unwrap(run.truth.heading))
    assert np.median(abs(np.angle(np.exp(1j * (late["heading"] - true))))) < 0.5  # it was 1.9
